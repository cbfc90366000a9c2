"""Ends a wait inside a library that offers no way to end it, by the descriptors that it waits for.

Works on Linux, where the descriptors of a process can be listed; elsewhere the library's own time-out ends
the wait.
"""

from __future__ import annotations

import os
import socket
import stat

_DESCRIPTORS = "/proc/self/fd"
_FAMILIES = (socket.AF_INET, socket.AF_INET6)


def own_sockets() -> set[tuple[int, int]]:
    """Sockets of this process: descriptor and inode of each."""
    found = set()
    for descriptor in _descriptors():
        try:
            status = os.fstat(descriptor)
        except OSError:  # closed meanwhile
            continue
        if stat.S_ISSOCK(status.st_mode):
            found.add((descriptor, status.st_ino))
    return found


def shut_down(sockets: set[tuple[int, int]], port: int) -> None:
    """Shut down those sockets that are connected to a port; whoever waits for them is woken."""
    for descriptor, inode in sockets:
        try:
            with socket.socket(fileno=os.dup(descriptor)) as peer:
                same = os.fstat(peer.fileno()).st_ino == inode and peer.family in _FAMILIES
                if same and peer.getpeername()[1] == port:
                    peer.shutdown(socket.SHUT_RDWR)
        except OSError:  # closed meanwhile, or not connected
            continue


def descriptors_of(path: str) -> list[int]:
    """Descriptors of this process that are open on a device."""
    real = os.path.realpath(path)
    found = []
    for descriptor in _descriptors():
        try:
            if os.readlink(f"{_DESCRIPTORS}/{descriptor}") == real:  # noqa: PTH115 - a descriptor's link
                found.append(descriptor)
        except OSError:  # closed meanwhile
            continue
    return found


def _descriptors() -> list[int]:
    try:
        return [int(name) for name in os.listdir(_DESCRIPTORS)]  # noqa: PTH208 - names only
    except OSError:  # not Linux
        return []

"""Abort a wait inside a library without a cancel function, through the descriptors that it waits for.

Works on Linux, where a process can list its descriptors; elsewhere the library's own timeout ends the wait.
"""

from __future__ import annotations

import os
import socket
import stat

_DESCRIPTORS = "/proc/self/fd"
_FAMILIES = (socket.AF_INET, socket.AF_INET6)


def own_sockets() -> set[tuple[int, int]]:
    """Yield descriptor and inode of each socket of this process."""
    found = set()
    for descriptor in _descriptors():
        try:
            status = os.fstat(descriptor)
        except OSError:  # closed in the meantime
            continue
        if stat.S_ISSOCK(status.st_mode):
            found.add((descriptor, status.st_ino))
    return found


def shut_down(sockets: set[tuple[int, int]], port: int) -> None:
    """Shut down the sockets that are connected to a port, which wakes their readers."""
    for descriptor, inode in sockets:
        try:
            with socket.socket(fileno=os.dup(descriptor)) as peer:
                same = os.fstat(peer.fileno()).st_ino == inode and peer.family in _FAMILIES
                if same and peer.getpeername()[1] == port:
                    peer.shutdown(socket.SHUT_RDWR)
        except OSError:  # closed in the meantime, or not connected
            continue


def descriptors_of(path: str) -> list[int]:
    """Return the descriptors of this process that are open on a device."""
    real = os.path.realpath(path)
    found = []
    for descriptor in _descriptors():
        try:
            if os.readlink(f"{_DESCRIPTORS}/{descriptor}") == real:  # noqa: PTH115 - a descriptor's link
                found.append(descriptor)
        except OSError:  # closed in the meantime
            continue
    return found


def _descriptors() -> list[int]:
    try:
        return [int(name) for name in os.listdir(_DESCRIPTORS)]  # noqa: PTH208 - names only
    except OSError:  # not Linux
        return []

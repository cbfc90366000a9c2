"""Keeps the receive sockets of a domain on the loopback device.

Cyclone DDS binds them to every address even where only the loopback interface is configured, and has no
setting against it. Tied to the device, they take nothing that comes over a network.
"""

from __future__ import annotations

import contextlib
import ipaddress
import logging
import os
import socket
import stat
import sys
from collections.abc import Iterator
from pathlib import Path

_log = logging.getLogger("joshua.transport")
_MACOS_IP_BOUND_IF = 25  # netinet/in.h


@contextlib.contextmanager
def sockets_on_loopback(wanted: bool) -> Iterator[None]:
    """Ties the datagram sockets that are opened inside the block to the loopback device.

    Args:
        wanted: whether to do anything.
    """
    before = _open_sockets() if wanted else {}
    yield
    if not wanted:
        return
    for inode, descriptor in _open_sockets().items():
        if inode not in before:
            _tie(descriptor)


def _open_sockets() -> dict[int, int]:
    """Descriptors of this process's sockets by inode."""
    folder = Path("/proc/self/fd" if sys.platform.startswith("linux") else "/dev/fd")
    found = {}
    for entry in folder.iterdir():
        with contextlib.suppress(OSError, ValueError):
            status = os.fstat(int(entry.name))
            if stat.S_ISSOCK(status.st_mode):
                found[status.st_ino] = int(entry.name)
    return found


def _tie(descriptor: int) -> None:
    try:
        copy = os.dup(descriptor)
    except OSError:
        return  # another thread has closed it meanwhile
    with contextlib.closing(socket.socket(fileno=copy)) as end:
        if end.type != socket.SOCK_DGRAM or end.family != socket.AF_INET:
            return
        if not ipaddress.ip_address(end.getsockname()[0]).is_unspecified:
            return
        try:
            if sys.platform == "darwin":
                index = socket.if_nametoindex("lo0")
                end.setsockopt(socket.IPPROTO_IP, _MACOS_IP_BOUND_IF, index)
            else:
                end.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, b"lo")
        except OSError as error:
            _log.warning(
                "a DDS socket stays open to the network, because the system does not let it be tied to the "
                "loopback device (%s); a firewall can close it",
                error,
            )

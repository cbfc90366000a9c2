"""Whose TCP sockets these are: the users of both ends of a connection inside this machine.

Source: proc_pid_net(5). Only Linux tells; elsewhere every owner is unknown.
"""

from __future__ import annotations

import ipaddress
import os
import socket
from collections.abc import Iterator
from pathlib import Path

_TABLES = (Path("/proc/net/tcp"), Path("/proc/net/tcp6"))
_OVERFLOW = Path("/proc/sys/kernel/overflowuid")
_ESTABLISHED, _LISTENING = "01", "0A"
Address = tuple[str, int]


def is_trusted(user: int | None) -> bool:
    """Whether sockets of a user are as good as this process's own: its own user, and root."""
    if user is None or user == _unmapped():
        return False
    return user in (os.geteuid(), 0)


def peer_owner(link: socket.socket) -> int | None:
    """User id of the process at the other end of an accepted connection; None if it is unknown.

    The other end of a connection inside this machine is a socket of the same table. While ``link`` is open,
    no other socket can have its addresses.
    """
    try:
        peer, own = _plain(link.getpeername()), _plain(link.getsockname())
    except OSError:  # closed meanwhile
        return None
    for state, local, remote, user in _sockets():
        if state == _ESTABLISHED and local == peer and remote == own:
            return user
    return None


def listener_owner(port: int) -> int | None:
    """User id of the program that accepts connections on a port of this machine.

    If several programs do, it is one that is not trusted, if there is one. None if it is unknown.
    """
    users = [user for state, local, _, user in _sockets() if state == _LISTENING and local[1] == port]
    return next((user for user in users if not is_trusted(user)), users[0] if users else None)


def _sockets() -> Iterator[tuple[str, Address, Address, int]]:
    """State, local address, remote address and user of every TCP socket."""
    for table in _TABLES:
        try:
            lines = table.read_text(encoding="ascii").splitlines()[1:]
        except OSError:
            continue
        for line in lines:
            fields = line.split()
            yield fields[3], _address(fields[1]), _address(fields[2]), int(fields[7])


def _address(text: str) -> Address:
    """An address of the table: 32-bit words in the byte order of the machine, and the port."""
    words, port = text.split(":")
    raw = bytes.fromhex(words)
    order = socket.htonl(1) == 1
    parts = [raw[start : start + 4] for start in range(0, len(raw), 4)]
    packed = b"".join(part if order else part[::-1] for part in parts)
    return _plain((str(ipaddress.ip_address(packed)), int(port, 16)))


def _plain(address: tuple[object, ...]) -> Address:
    """Host and port, with IPv4 addresses of IPv6 sockets written as IPv4."""
    host = ipaddress.ip_address(str(address[0]).partition("%")[0])
    mapped = getattr(host, "ipv4_mapped", None)
    return str(mapped or host), int(str(address[1]))


def _unmapped() -> int | None:
    """The number that stands for all users outside this container."""
    try:
        return int(_OVERFLOW.read_text(encoding="ascii"))
    except (OSError, ValueError):
        return None

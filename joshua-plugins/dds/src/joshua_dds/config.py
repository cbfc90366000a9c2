"""Cyclone DDS configuration of a domain, made from the transport specification.

The discovery ranges follow ROS 2's rmw_cyclonedds, except that LOCALHOST also binds to the loopback
interface, so that nothing listens on a network. Even then, Cyclone DDS binds its receive sockets to every
address, without a setting against it; bound to the loopback device, they receive nothing from a network.
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
from xml.sax.saxutils import quoteattr

from joshua.api.transports import TransportError, TransportSettings

_log = logging.getLogger("joshua.transport")
_FILE_URI = "file://"
_MACOS_IP_BOUND_IF = 25  # netinet/in.h


@contextlib.contextmanager
def sockets_on_loopback(wanted: bool) -> Iterator[None]:
    """Bind the datagram sockets that are opened inside the block to the loopback device.

    Args:
        wanted: whether to bind them.
    """
    before = _open_sockets() if wanted else {}
    yield
    if not wanted:
        return
    for inode, descriptor in _open_sockets().items():
        if inode not in before:
            _tie(descriptor)


def _open_sockets() -> dict[int, int]:
    """Return the descriptors of this process's sockets by inode."""
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
                "a DDS socket stays open to the network: the system does not allow binding it to the "
                "loopback device (%s). Block it with a firewall",
                error,
            )


_LOOPBACK = '<NetworkInterface address="127.0.0.1"/>'
# One participant per process; ROS 2 looks for this number in this mode, too.
_MAX_PARTICIPANT_INDEX = 32
# The graph drops a killed process after this time.
_LEASE_S = 3
# A 640 × 480 image in 15 datagrams instead of 700: two thirds of its latency.
_DATAGRAM_B = 65500
_FRAGMENT_B = 65000
# A writer holds this much for slow readers before it waits or drops: 17 images of 640 × 480, 3 of 1080p.
_UNSENT_HIGH_MB = 16
# How long closing waits for a reader that does not reply.
_LINGER_MS = 100


def require_usable(settings: TransportSettings) -> None:
    """Check interface, peers and settings files, because the middleware itself reports less, or aborts.

    Raises:
        TransportError: names the setting that cannot be used, why, and what to do.
    """
    _require_interface(settings.network_interface)
    for peer in settings.peers:
        _require_host(peer)
    for part in os.environ.get("CYCLONEDDS_URI", "").split(","):
        path = part.strip().removeprefix(_FILE_URI)
        if part.strip().startswith(_FILE_URI) and not Path(path).is_file():
            raise TransportError(f"CYCLONEDDS_URI names {path}, which is not a file. Correct or unset it")


def _require_interface(name: str) -> None:
    names = [interface for _, interface in socket.if_nameindex()]
    if not name or name in names:
        return
    try:
        ipaddress.ip_address(name)
    except ValueError:
        raise TransportError(
            f"network_interface: this machine has no interface {name!r}. It has {', '.join(names)}"
        ) from None


def _require_host(peer: str) -> None:
    with_port = peer.count(":") == 1 or "]:" in peer
    host = (peer.rpartition(":")[0] if with_port else peer).strip("[]")
    try:
        socket.getaddrinfo(host, None)
    except UnicodeError as error:
        raise TransportError(
            f"peers: {host!r} is not a host name or address. Write an address such as 192.168.1.20"
        ) from error
    except OSError as error:
        raise TransportError(
            f"peers: the host name {host!r} cannot be resolved ({error.strerror}). Write its address, or add "
            "it to /etc/hosts"
        ) from error


def stays_local(settings: TransportSettings) -> bool:
    """Return whether the domain is limited to this machine, and no user settings override that."""
    narrow = settings.discovery_range in ("OFF", "LOCALHOST")
    return narrow and not settings.network_interface and not os.environ.get("CYCLONEDDS_URI")


def domain_config(settings: TransportSettings) -> str:
    """Return the XML configuration; settings of ``CYCLONEDDS_URI`` follow and override it, as in ROS 2."""
    general = [f"<MaxMessageSize>{_DATAGRAM_B}B</MaxMessageSize><FragmentSize>{_FRAGMENT_B}B</FragmentSize>"]
    discovery = [f"<LeaseDuration>{_LEASE_S}s</LeaseDuration>"]
    peers = [f"<Peer address={quoteattr(peer)}/>" for peer in settings.peers]
    if settings.discovery_range == "OFF":
        general.append(f"<Interfaces>{_LOOPBACK}</Interfaces><AllowMulticast>false</AllowMulticast>")
        discovery.append("<ParticipantIndex>none</ParticipantIndex>")
        # no other process has the same tag, so none is found
        discovery.append(f"<Tag>ros_discovery_off_{os.getpid()}</Tag>")
    else:
        discovery.append(
            "<ParticipantIndex>auto</ParticipantIndex>"
            f"<MaxAutoParticipantIndex>{_MAX_PARTICIPANT_INDEX}</MaxAutoParticipantIndex>"
        )
        if settings.network_interface:
            name = f"<NetworkInterface name={quoteattr(settings.network_interface)}/>"
            general.append(f"<Interfaces>{name}</Interfaces>")
        if settings.discovery_range == "LOCALHOST":
            if not settings.network_interface:
                general.append(f"<Interfaces>{_LOOPBACK}</Interfaces>")
            general.append("<AllowMulticast>false</AllowMulticast>")
            peers.append('<Peer address="localhost"/>')
        if peers:
            discovery.append(f"<Peers>{''.join(peers)}</Peers>")
    internal = (
        f"<Watermarks><WhcHigh>{_UNSENT_HIGH_MB}MB</WhcHigh><WhcHighInit>{_UNSENT_HIGH_MB}MB</WhcHighInit><WhcAdaptive>false</WhcAdaptive></Watermarks>"
        f"<WriterLingerDuration>{_LINGER_MS}ms</WriterLingerDuration>"
    )
    config = (
        f'<CycloneDDS><Domain id="any"><General>{"".join(general)}</General>'
        f"<Discovery>{''.join(discovery)}</Discovery><Internal>{internal}</Internal></Domain></CycloneDDS>"
    )
    more = os.environ.get("CYCLONEDDS_URI", "")
    return f"{config},{more}" if more else config

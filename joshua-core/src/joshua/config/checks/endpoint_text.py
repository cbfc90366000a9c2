"""Transport endpoints as they are written: ``protocol/address:port``."""

from __future__ import annotations

import ipaddress
import re
from typing import NamedTuple

PROTOCOLS = ("tcp", "tls", "quic", "udp", "ws", "unixsock-stream")
SECURE_PROTOCOLS = ("tls", "quic")
_HOST = r"[A-Za-z0-9*]([A-Za-z0-9_.*-]*[A-Za-z0-9])?"
_LOOPBACK_NAMES = ("localhost", "ip6-localhost", "localhost.localdomain")


class EndpointText(NamedTuple):
    """An endpoint in its parts; ``fault`` says which rule the text breaks, "" for none."""

    protocol: str
    host: str
    port: str
    fault: str = ""

    @property
    def is_loopback(self) -> bool:
        """Whether only this machine reaches the endpoint."""
        return self.protocol == "unixsock-stream" or is_loopback(self.host)


def parse_endpoint(text: str) -> EndpointText:
    """Takes a Zenoh endpoint such as ``tls/0.0.0.0:7447`` or ``tcp/[::1]:7447`` apart."""
    protocol, slash, rest = text.partition("/")
    rest = rest.partition("?")[0].partition("#")[0]
    if not slash:
        return EndpointText("", "", "", "An endpoint is written protocol/address:port")
    if protocol not in PROTOCOLS:
        return EndpointText(protocol, "", "", f"{protocol or 'An empty word'} is no protocol of an endpoint")
    if protocol == "unixsock-stream":
        return EndpointText(protocol, rest, "", "" if rest else "The path of the socket is missing")
    host, colon, port = rest.rpartition(":")
    if not colon or not host:
        return EndpointText(protocol, rest, "", "An endpoint needs an address and a port")
    if not (port.isascii() and port.isdigit() and 1 <= int(port[:6]) <= 65535):
        return EndpointText(protocol, host, port, "A port is a number from 1 to 65535")
    if not is_address(host.removeprefix("[").removesuffix("]")):
        return EndpointText(protocol, host, port, f"{host} is neither a host name nor an address")
    return EndpointText(protocol, host, port)


def is_address(host: str) -> bool:
    """Whether a text is an IP address or can be a host name."""
    return _ip(host) is not None or re.fullmatch(_HOST, host) is not None


def is_loopback(host: str) -> bool:
    """Whether an address or name stands for this machine alone."""
    address = _ip(host.removeprefix("[").removesuffix("]"))
    return address.is_loopback if address is not None else host.lower() in _LOOPBACK_NAMES


def _ip(host: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    try:
        return ipaddress.ip_address(host)
    except ValueError:
        return None

"""Zenoh endpoints such as ``tcp/localhost:7447`` as data"""

from __future__ import annotations

import ipaddress
import re
from dataclasses import dataclass

from joshua.transport.transports import TransportError

_ENDPOINT = re.compile(
    r"^(?P<protocol>[a-z]+)/(?P<host>\[[0-9a-fA-F:.%]+\]|[^:/\[\]#?]+):(?P<port>\d{1,5})(?P<rest>[#?].*)?$"
)
_ENCRYPTED = ("tls", "quic")
_PROTOCOLS = ("tcp", *_ENCRYPTED, "udp", "ws")


@dataclass(frozen=True)
class Endpoint:
    """An address on which a Zenoh router listens.

    Attributes:
        protocol: such as ``tcp`` or ``tls``; host: name or address, without brackets.
        port: 0 lets the system choose; rest: link settings after ``#`` or ``?``.
    """

    protocol: str
    host: str
    port: int
    rest: str = ""

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{self.protocol}/{host}:{self.port}{self.rest}"

    @property
    def encrypted(self) -> bool:
        """Whether it requires certificates."""
        return self.protocol in _ENCRYPTED

    @property
    def loopback(self) -> bool:
        """Whether only this machine reaches it."""
        if self.host == "localhost":
            return True
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False

    @property
    def local(self) -> Endpoint:
        """The address for processes on this machine: ``0.0.0.0`` and ``::`` become ``localhost``."""
        try:
            anywhere = ipaddress.ip_address(self.host).is_unspecified
        except ValueError:
            anywhere = False
        return Endpoint(self.protocol, "localhost", self.port) if anywhere else self


def read_endpoint(text: str) -> Endpoint:
    """Parses an endpoint.

    Raises:
        TransportError: not of the form ``protocol/host:port``.
    """
    match = _ENDPOINT.match(text)
    if match is None or match["protocol"] not in _PROTOCOLS or int(match["port"]) > 65535:
        raise TransportError(
            f"{text!r} is not a Zenoh endpoint; write protocol/host:port with one of the protocols "
            f"{', '.join(_PROTOCOLS)}, such as tcp/localhost:7447"
        )
    return Endpoint(match["protocol"], match["host"].strip("[]"), int(match["port"]), match["rest"] or "")

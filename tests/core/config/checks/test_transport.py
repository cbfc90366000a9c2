"""Transport endpoints in their parts."""

from __future__ import annotations

import pytest
from joshua.config.checks.transport import is_address, is_loopback, parse_endpoint


@pytest.mark.parametrize(
    ("text", "protocol", "host", "port", "loopback"),
    [
        ("tcp/localhost:7447", "tcp", "localhost", "7447", True),
        ("tcp/127.0.0.1:7447", "tcp", "127.0.0.1", "7447", True),
        ("tcp/[::1]:7447", "tcp", "[::1]", "7447", True),
        ("tls/0.0.0.0:7447", "tls", "0.0.0.0", "7447", False),
        ("tls/robot.local:1", "tls", "robot.local", "1", False),
        ("tcp/[fe80::1]:65535", "tcp", "[fe80::1]", "65535", False),
        ("udp/192.168.1.4:7447?rel=1#iface=eth0", "udp", "192.168.1.4", "7447", False),
        ("unixsock-stream/tmp/joshua.sock", "unixsock-stream", "tmp/joshua.sock", "", True),
    ],
)
def test_valid_endpoints(text: str, protocol: str, host: str, port: str, loopback: bool) -> None:
    endpoint = parse_endpoint(text)
    assert endpoint.fault == ""
    assert (endpoint.protocol, endpoint.host, endpoint.port, endpoint.is_loopback) == (
        protocol,
        host,
        port,
        loopback,
    )


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("localhost:7447", "protocol/address:port"),
        ("", "protocol/address:port"),
        ("http/localhost:80", "http is no protocol"),
        ("/localhost:80", "An empty word is no protocol"),
        ("tcp/localhost", "needs an address and a port"),
        ("tcp/:7447", "needs an address and a port"),
        ("tcp/localhost:0", "1 to 65535"),
        ("tcp/localhost:99999999999999999999", "1 to 65535"),
        ("tcp/localhost:٣", "1 to 65535"),
        ("tcp/ro bot:7447", "neither a host name"),
        ("unixsock-stream/", "path of the socket"),
    ],
)
def test_broken_endpoints(text: str, fault: str) -> None:
    assert fault.lower() in parse_endpoint(text).fault.lower()


def test_addresses() -> None:
    assert is_address("192.168.1.20")
    assert is_address("robot-2.local")
    assert not is_address("192.168.1.20:7447 ")
    assert not is_address("")
    assert is_loopback("127.4.5.6")
    assert not is_loopback("10.0.0.1")

"""The transport block: endpoints, encryption, and fields unused by the selected middleware."""

from __future__ import annotations

import ipaddress
import re
from collections.abc import Iterator
from typing import NamedTuple

from joshua.config.checks.context import Context
from joshua.config.checks.device_table import value_name
from joshua.config.checks.identity import title
from joshua.plan import Diagnostic
from joshua.schema import transport_pb2 as pb
from joshua.textproto.nearest import nearest

PROTOCOLS = ("tcp", "tls", "quic", "udp", "ws", "unixsock-stream")
SECURE_PROTOCOLS = ("tls", "quic")
_HOST = r"[A-Za-z0-9*]([A-Za-z0-9_.*-]*[A-Za-z0-9])?"
_LOOPBACK_NAMES = ("localhost", "ip6-localhost", "localhost.localdomain")
_ZENOH_FIELDS = ("listen_endpoints", "connect_endpoints", "tls", "open_to_local_users")
_DDS_FIELDS = ("network_interface", "peers")


def check(context: Context) -> Iterator[Diagnostic]:
    """Check the transport block, and whether nodes on several machines reach each other."""
    transport = context.config.transport
    endpoints = [
        (f"transport.{field}[{index}]", parse_endpoint(text))
        for field in _ZENOH_FIELDS[:2]
        for index, text in enumerate(getattr(transport, field))
    ]
    yield from _machines(context, endpoints)
    yield from _other_kind(context, transport)
    yield from _plugin_kind(context, transport)
    for path, endpoint in endpoints:
        if endpoint.fault:
            allowed: tuple[str, ...] = ('"tcp/localhost:7447"', '"tls/robot.local:7447"')
            if endpoint.protocol and endpoint.protocol not in PROTOCOLS:
                allowed = tuple(dict.fromkeys([*nearest(endpoint.protocol, PROTOCOLS), *PROTOCOLS]))
            yield context.error("endpoint-invalid", endpoint.fault, path, allowed=allowed)
    if transport.kind != pb.TRANSPORT_DDS:  # otherwise they are reported as unused
        yield from _tls(context, transport, endpoints)
        for path, endpoint in endpoints[: len(transport.listen_endpoints)]:
            is_open = not (endpoint.fault or endpoint.is_loopback or endpoint.protocol in SECURE_PROTOCOLS)
            if is_open:
                place = f"{endpoint.host}:{endpoint.port}"
                yield context.warning(
                    "transport-open",
                    f"Everyone who reaches {place} can read every topic and command the robot: "
                    f"{endpoint.protocol} has neither encryption nor certificates",
                    path,
                    allowed=(f'"tls/{place}"', f'"tcp/localhost:{endpoint.port}"'),
                )
        if transport.open_to_local_users:
            yield context.warning(
                "transport-open-locally",
                "Every user of this machine can command the robot and call every service of its nodes",
                "transport.open_to_local_users",
                allowed=("false",),
            )
    if transport.kind != pb.TRANSPORT_ZENOH:
        yield from _dds(context, transport)


def _other_kind(context: Context, transport: pb.TransportConfig) -> Iterator[Diagnostic]:
    is_zenoh = transport.kind == pb.TRANSPORT_ZENOH
    unused = {pb.TRANSPORT_ZENOH: _DDS_FIELDS, pb.TRANSPORT_DDS: _ZENOH_FIELDS}.get(transport.kind, ())
    owner = "DDS" if is_zenoh else "Zenoh"
    kind = value_name(pb.TransportKind, transport.kind)
    written = {field.name for field, _ in transport.ListFields()}
    for field in (name for name in unused if name in written):
        yield context.error(
            "transport-field-unused",
            f"{field} is a setting of {owner} and has no effect with {kind}",
            f"transport.{field}",
            found=field,
            allowed=_ZENOH_FIELDS if is_zenoh else _DDS_FIELDS,
            remedy=f"Remove it, or change kind to TRANSPORT_{owner.upper()}",
            related=context.see("transport.kind", "kind"),
        )


def _plugin_kind(context: Context, transport: pb.TransportConfig) -> Iterator[Diagnostic]:
    of_plugin, path = transport.kind == pb.TRANSPORT_PLUGIN, "transport.plugin_kind"
    if of_plugin and not transport.plugin_kind:
        message = "TRANSPORT_PLUGIN requires plugin_kind, the name of the transport"
        remedy = 'Add plugin_kind: "..." to transport. `joshua plugins` lists what plugins provide'
        yield context.error("required-missing", message, path, remedy=remedy)
    elif transport.plugin_kind and not of_plugin:
        message = "plugin_kind has no effect without kind: TRANSPORT_PLUGIN"
        remedy = "Remove it, or change kind to TRANSPORT_PLUGIN"
        yield context.error("transport-field-unused", message, path, remedy=remedy)


def _tls(
    context: Context, transport: pb.TransportConfig, endpoints: list[tuple[str, EndpointText]]
) -> Iterator[Diagnostic]:
    good = [item for item in endpoints if not item[1].fault]
    secure = [item for item in good if item[1].protocol in SECURE_PROTOCOLS]
    if secure and not transport.HasField("tls"):
        path, endpoint = secure[0]
        message = f"A {endpoint.protocol} endpoint requires certificates, but there is no tls block"
        yield context.error("tls-missing", message, path)
    if not transport.HasField("tls"):
        return
    if not secure and len(good) == len(endpoints):
        yield context.error(
            "tls-unused",
            "The certificates protect nothing: no endpoint is a tls endpoint",
            "transport.tls",
            allowed=('listen_endpoints: "tls/0.0.0.0:7447"', 'connect_endpoints: "tls/robot.local:7447"'),
        )
    if secure and transport.kind == pb.TRANSPORT_AUTO:
        message = (
            "tls protects Zenoh only; without a kind the environment may choose DDS, which is not encrypted"
        )
        yield context.warning("tls-may-not-hold", message, "transport.kind", allowed=("TRANSPORT_ZENOH",))


def _dds(context: Context, transport: pb.TransportConfig) -> Iterator[Diagnostic]:
    for index, peer in enumerate(transport.peers):
        if not is_address(peer):
            yield context.error(
                "peer-invalid",
                "A peer is a host name or an IP address without protocol and port",
                f"transport.peers[{index}]",
                allowed=('"192.168.1.20"', '"robot.local"'),
            )
    name = transport.network_interface
    if name and name != "lo" and not is_loopback(name):
        yield context.warning(
            "transport-open",
            f"Everyone on the network of {name} can read every topic and command the robot: "
            "DDS is not encrypted here",
            "transport.network_interface",
            allowed=('"lo"', "kind: TRANSPORT_ZENOH with tls endpoints"),
            remedy="Use it only on a network that you trust, or use Zenoh with tls",
        )


def _machines(context: Context, endpoints: list[tuple[str, EndpointText]]) -> Iterator[Diagnostic]:
    """Nodes on several machines require a transport that leaves loopback."""
    transport = context.config.transport
    entries = {entry.node.host: entry for entry in reversed(context.graph.entries) if entry.node.host}
    leaves = any(not endpoint.is_loopback for _, endpoint in endpoints)
    if len(entries) < 2 or transport.network_interface or transport.peers or leaves:
        return
    first, second = [entry for entry in context.graph.entries if entries.get(entry.node.host) is entry][:2]
    yield context.warning(
        "hosts-apart",
        f"{title(second)} runs on {second.node.host} and other nodes run on {first.node.host}, but the "
        "transport stays on loopback, so they cannot reach each other",
        f"{second.path}.host",
        found=", ".join(sorted(entries)),
        related=context.see(f"{first.path}.host", f"first machine, {first.node.host}"),
    )


class EndpointText(NamedTuple):
    """The parts of a Zenoh endpoint. ``fault``: the rule that the text breaks, "" for none."""

    protocol: str
    host: str
    port: str
    fault: str = ""

    @property
    def is_loopback(self) -> bool:
        """Whether only this machine reaches the endpoint."""
        return self.protocol == "unixsock-stream" or is_loopback(self.host)


def parse_endpoint(text: str) -> EndpointText:
    """Parse a Zenoh endpoint such as ``tls/0.0.0.0:7447`` or ``tcp/[::1]:7447``."""
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
    """Whether a text is an IP address or a possible host name."""
    return _ip(host) is not None or re.fullmatch(_HOST, host) is not None


def is_loopback(host: str) -> bool:
    """Whether an address or name means this machine only."""
    address = _ip(host.removeprefix("[").removesuffix("]"))
    return address.is_loopback if address is not None else host.lower() in _LOOPBACK_NAMES


def _ip(host: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    try:
        return ipaddress.ip_address(host)
    except ValueError:
        return None

"""The transport block: endpoints, encryption, and fields that the chosen middleware does not use."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from joshua.config.checks.context import Context
from joshua.config.checks.endpoint_text import (
    PROTOCOLS,
    SECURE_PROTOCOLS,
    EndpointText,
    is_address,
    is_loopback,
    parse_endpoint,
)
from joshua.plan import Diagnostic
from joshua.schema import transport_pb2 as pb
from joshua.textproto.nearest import nearest

_ZENOH_FIELDS = ("listen_endpoints", "connect_endpoints", "tls")
_DDS_FIELDS = ("network_interface", "peers")


def check(context: Context) -> Iterator[Diagnostic]:
    """Checks the transport block."""
    transport = context.config.transport
    yield from _other_kind(context, transport)
    yield from _plugin_kind(context, transport)
    listen = list(_endpoints(context, "listen_endpoints", transport.listen_endpoints))
    connect = list(_endpoints(context, "connect_endpoints", transport.connect_endpoints))
    for path, text, endpoint in [*listen, *connect]:
        if endpoint.fault:
            yield _bad_endpoint(context, path, text, endpoint)
    good = [item for item in [*listen, *connect] if not item[2].fault]
    yield from _tls(context, transport, good)
    if transport.kind != pb.TRANSPORT_DDS:
        for path, text, endpoint in listen:
            if not endpoint.fault and not endpoint.is_loopback and endpoint.protocol not in SECURE_PROTOCOLS:
                yield _open_door(context, path, text, endpoint)
    yield from _dds(context, transport)


def _endpoints(
    context: Context, field: str, values: Sequence[str]
) -> Iterator[tuple[str, str, EndpointText]]:
    for index, text in enumerate(values):
        yield f"transport.{field}[{index}]", text, parse_endpoint(text)


def _bad_endpoint(context: Context, path: str, text: str, endpoint: EndpointText) -> Diagnostic:
    allowed: tuple[str, ...] = ('"tcp/localhost:7447"', '"tls/robot.local:7447"')
    if endpoint.protocol and endpoint.protocol not in PROTOCOLS:
        allowed = tuple(dict.fromkeys([*nearest(endpoint.protocol, PROTOCOLS), *PROTOCOLS]))
    return context.error("endpoint-invalid", endpoint.fault, path, allowed=allowed)


def _other_kind(context: Context, transport: pb.TransportConfig) -> Iterator[Diagnostic]:
    unused = {pb.TRANSPORT_ZENOH: _DDS_FIELDS, pb.TRANSPORT_DDS: _ZENOH_FIELDS}.get(transport.kind, ())
    owner = "DDS" if transport.kind == pb.TRANSPORT_ZENOH else "Zenoh"
    for field in unused:
        if field == "tls" and not transport.HasField("tls"):
            continue
        if not getattr(transport, field):
            continue
        path = f"transport.{field}"
        kind = pb.TransportKind.Name(transport.kind)
        yield context.error(
            "transport-field-unused",
            f"{field} is a setting of {owner} and has no effect with {kind}",
            path,
            found=field,
            allowed=_ZENOH_FIELDS if transport.kind == pb.TRANSPORT_ZENOH else _DDS_FIELDS,
            remedy=f"Remove it, or change kind to TRANSPORT_{owner.upper()}",
            related=context.see("transport.kind", "kind"),
        )


def _plugin_kind(context: Context, transport: pb.TransportConfig) -> Iterator[Diagnostic]:
    of_plugin = transport.kind == pb.TRANSPORT_PLUGIN
    if of_plugin and not transport.plugin_kind:
        yield context.error(
            "required-missing",
            "TRANSPORT_PLUGIN requires plugin_kind, the name of the transport",
            "transport.plugin_kind",
            remedy='Add plugin_kind: "..." to transport. `joshua plugins` lists what plugins provide',
        )
    elif transport.plugin_kind and not of_plugin:
        yield context.error(
            "transport-field-unused",
            "plugin_kind has no effect without kind: TRANSPORT_PLUGIN",
            "transport.plugin_kind",
            remedy="Remove it, or change kind to TRANSPORT_PLUGIN",
        )


def _tls(
    context: Context, transport: pb.TransportConfig, endpoints: list[tuple[str, str, EndpointText]]
) -> Iterator[Diagnostic]:
    if transport.kind == pb.TRANSPORT_DDS:
        return  # reported as unused
    secure = [item for item in endpoints if item[2].protocol in SECURE_PROTOCOLS]
    if secure and not transport.HasField("tls"):
        path, _, endpoint = secure[0]
        yield context.error(
            "tls-missing",
            f"A {endpoint.protocol} endpoint needs certificates, and there is no tls block",
            path,
        )
    if not transport.HasField("tls"):
        return
    has_faults = len(endpoints) < len(transport.listen_endpoints) + len(transport.connect_endpoints)
    if not secure and not has_faults:
        yield context.error(
            "tls-unused",
            "The certificates protect nothing: no endpoint is a tls endpoint",
            "transport.tls",
            allowed=('listen_endpoints: "tls/0.0.0.0:7447"', 'connect_endpoints: "tls/robot.local:7447"'),
        )
    if secure and transport.kind == pb.TRANSPORT_AUTO:
        yield context.warning(
            "tls-may-not-hold",
            "tls holds for Zenoh alone, and without a kind the environment may choose DDS, "
            "which is not encrypted",
            "transport.kind",
            allowed=("TRANSPORT_ZENOH",),
        )


def _open_door(context: Context, path: str, text: str, endpoint: EndpointText) -> Diagnostic:
    return context.warning(
        "transport-open",
        f"Everyone who reaches {endpoint.host}:{endpoint.port} can read every topic and command the robot: "
        f"{endpoint.protocol} has neither encryption nor certificates",
        path,
        allowed=(f'"tls/{endpoint.host}:{endpoint.port}"', f'"tcp/localhost:{endpoint.port}"'),
        remedy="Use a tls endpoint with a tls block, or listen on localhost only",
    )


def _dds(context: Context, transport: pb.TransportConfig) -> Iterator[Diagnostic]:
    if transport.kind == pb.TRANSPORT_ZENOH:
        return  # reported as unused
    for index, peer in enumerate(transport.peers):
        path = f"transport.peers[{index}]"
        if not is_address(peer):
            yield context.error(
                "peer-invalid",
                "A peer is a host name or an IP address without protocol and port",
                path,
                allowed=('"192.168.1.20"', '"robot.local"'),
            )
    name = transport.network_interface
    if name and name != "lo" and not is_loopback(name):
        path = "transport.network_interface"
        yield context.warning(
            "transport-open",
            f"Everyone on the network of {name} can read every topic and command the robot: "
            "DDS is not encrypted here",
            path,
            allowed=('"lo"', "kind: TRANSPORT_ZENOH with tls endpoints"),
            remedy="Use it on a network that you trust alone, or use Zenoh with tls",
        )

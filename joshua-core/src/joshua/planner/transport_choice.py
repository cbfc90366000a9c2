"""The transport of a plan: the file's block, else the environment, else the embedded default."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import TYPE_CHECKING, Literal

from joshua.plan import Diagnostic, TlsSpec, TransportSpec, installing
from joshua.schema import transport_pb2
from joshua.transport.choose import TransportBlock, TransportChoiceError, choose_transport, dds_installed

if TYPE_CHECKING:
    from joshua.config.checks import Context

_ZENOH_FIELDS = ("listen_endpoints", "connect_endpoints", "tls")
_DDS_FIELDS = ("network_interface", "peers")


def transport_spec(context: Context) -> tuple[TransportSpec | None, list[Diagnostic]]:
    """Choose the transport; None and the reason where the environment is wrong."""
    block, has_dds = _block(context), dds_installed()
    try:
        spec = choose_transport(block, os.environ, has_dds=has_dds)
    except TransportChoiceError as error:
        message = f"ROS 2 does not know the value of the environment variable {error.variable}"
        found = f"{error.variable}={error.found}"
        allowed, remedy = error.allowed, error.remedy
        problem = context.error("transport-environment", message, found=found, allowed=allowed, remedy=remedy)
        return None, [problem]
    problems = list(_unused(context, spec)) if block.kind == "auto" else []  # the checks know a named kind
    if spec.kind == "dds" and not has_dds:
        message = f"DDS was chosen ({spec.reason}), but the extra joshua-core[dds] is not installed"
        remedy = f"Run `{installing.install(installing.CORE, 'dds')}`, or set kind: TRANSPORT_ZENOH"
        path = "transport.kind"
        problems.append(context.missing("extra-missing", message, path, found="", remedy=remedy))
    return spec, problems


def _unused(context: Context, spec: TransportSpec) -> Iterator[Diagnostic]:
    """Settings of one middleware where the environment has chosen the other."""
    chosen, other = ("DDS", "Zenoh") if spec.kind == "dds" else ("Zenoh", "DDS")
    fields = _ZENOH_FIELDS if other == "Zenoh" else _DDS_FIELDS
    written = {field.name for field, _ in context.config.transport.ListFields()}
    for field in (name for name in fields if name in written):
        yield context.error(
            "transport-field-unused",
            f"{field} is a setting of {other}, but {chosen} was chosen: {spec.reason}",
            f"transport.{field}",
            found=field,
            remedy=f"Write kind: TRANSPORT_{other.upper()} into transport, or remove {field}",
        )


def _block(context: Context) -> TransportBlock:
    block = context.config.transport
    kinds: dict[int, Literal["zenoh", "dds"]] = {
        transport_pb2.TRANSPORT_ZENOH: "zenoh",
        transport_pb2.TRANSPORT_DDS: "dds",
    }
    return TransportBlock(
        kind=kinds.get(block.kind, "auto"),
        domain_id=block.domain_id if block.HasField("domain_id") else None,
        listen_endpoints=tuple(block.listen_endpoints),
        connect_endpoints=tuple(block.connect_endpoints),
        tls=_tls(context) if block.HasField("tls") else None,
        network_interface=block.network_interface,
        peers=tuple(block.peers),
    )


def _tls(context: Context) -> TlsSpec:
    from joshua.config.input_paths import with_absolute_paths

    block, loaded = context.config.transport.tls, context.loaded
    tls = with_absolute_paths(block, "transport.tls", loaded.positions, loaded.path)
    return TlsSpec(
        root_ca_file=tls.root_ca_file,
        certificate_file=tls.certificate_file,
        private_key_file=tls.private_key_file,
    )

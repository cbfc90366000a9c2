"""The transport of a plan: the file's block, else the environment, else the embedded default."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Literal

from joshua.plan import Severity, TlsSpec, TransportSpec
from joshua.schema import transport_pb2
from joshua.transport.choose import TransportBlock, TransportChoiceError, choose_transport, dds_installed

if TYPE_CHECKING:
    from joshua.planner.diagnostics import Diagnostics
    from joshua.schema import config_pb2 as pb

_ZENOH_FIELDS = ("listen_endpoints", "connect_endpoints", "tls")
_DDS_FIELDS = ("network_interface", "peers")


def transport_spec(config: pb.Config, source: str, findings: Diagnostics) -> TransportSpec | None:
    """Chooses the transport; a wrong environment or a missing extra becomes a finding, and None."""
    has_dds = dds_installed()
    try:
        spec = choose_transport(_block(config.transport, source, findings), os.environ, has_dds=has_dds)
    except TransportChoiceError as error:
        findings.add(
            "transport-environment",
            Severity.ERROR,
            f"The environment variable {error.variable} has a value that ROS 2 does not know",
            found=f"{error.variable}={error.found}",
            allowed=error.allowed,
            remedy=error.remedy,
        )
        return None
    _refuse_unused(config.transport, spec, findings)
    if spec.kind == "dds" and not has_dds:
        findings.add(
            "extra-missing",
            Severity.ERROR if findings.launch else Severity.NOTE,
            f"DDS was chosen ({spec.reason}), and the extra joshua-core[dds] is not installed",
            "transport.kind",
            remedy="pip install 'joshua-core[dds]', or choose TRANSPORT_ZENOH",
        )
    return spec


def _refuse_unused(block: transport_pb2.TransportConfig, spec: TransportSpec, findings: Diagnostics) -> None:
    """Settings of one middleware where the environment has chosen the other; the checks know a named kind."""
    if _kind(block) != "auto":
        return
    chosen, other = ("DDS", "Zenoh") if spec.kind == "dds" else ("Zenoh", "DDS")
    fields = _ZENOH_FIELDS if other == "Zenoh" else _DDS_FIELDS
    written = {field.name for field, _ in block.ListFields()}
    for field in (name for name in fields if name in written):
        findings.add(
            "transport-field-unused",
            Severity.ERROR,
            f"{field} is a setting of {other}, and {chosen} was chosen: {spec.reason}",
            f"transport.{field}",
            found=field,
            remedy=f"Write kind: TRANSPORT_{other.upper()} into transport, or remove {field}",
        )


def _block(block: transport_pb2.TransportConfig, source: str, findings: Diagnostics) -> TransportBlock:
    return TransportBlock(
        kind=_kind(block),
        domain_id=block.domain_id if block.HasField("domain_id") else None,
        listen_endpoints=tuple(block.listen_endpoints),
        connect_endpoints=tuple(block.connect_endpoints),
        tls=_tls(block, source, findings),
        network_interface=block.network_interface,
        peers=tuple(block.peers),
    )


def _kind(block: transport_pb2.TransportConfig) -> Literal["auto", "zenoh", "dds"]:
    if block.kind == transport_pb2.TRANSPORT_ZENOH:
        return "zenoh"
    return "dds" if block.kind == transport_pb2.TRANSPORT_DDS else "auto"


def _tls(block: transport_pb2.TransportConfig, source: str, findings: Diagnostics) -> TlsSpec | None:
    if not block.HasField("tls"):
        return None
    from joshua.config.input_paths import with_absolute_paths

    tls = with_absolute_paths(block.tls, "transport.tls", findings.positions, source)
    return TlsSpec(
        root_ca_file=tls.root_ca_file,
        certificate_file=tls.certificate_file,
        private_key_file=tls.private_key_file,
    )

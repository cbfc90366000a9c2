"""The transport of a plan: the file's block, else the environment, else the embedded default."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from joshua.plan import Severity, TlsSpec, TransportSpec
from joshua.schema import transport_pb2
from joshua.transport.choose import TransportBlock, TransportChoiceError, choose_transport, dds_installed

if TYPE_CHECKING:
    from joshua.generator.findings import Findings
    from joshua.schema import config_pb2 as pb


def transport_spec(config: pb.Config, source: str, findings: Findings) -> TransportSpec | None:
    """Chooses the transport; a wrong environment or a missing extra becomes a finding, and None."""
    has_dds = dds_installed()
    try:
        spec = choose_transport(_block(config.transport, Path(source).parent), os.environ, has_dds=has_dds)
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
    if spec.kind == "dds" and not has_dds:
        findings.add(
            "extra-missing",
            Severity.ERROR if findings.launch else Severity.NOTE,
            f"DDS was chosen ({spec.reason}), and the extra joshua-core[dds] is not installed",
            "transport.kind",
            remedy="pip install 'joshua-core[dds]', or choose TRANSPORT_ZENOH",
        )
    return spec


def _block(block: transport_pb2.TransportConfig, folder: Path) -> TransportBlock:
    return TransportBlock(
        kind=_kind(block),
        domain_id=block.domain_id if block.HasField("domain_id") else None,
        listen_endpoints=tuple(block.listen_endpoints),
        connect_endpoints=tuple(block.connect_endpoints),
        tls=_tls(block, folder),
        network_interface=block.network_interface,
        peers=tuple(block.peers),
    )


def _kind(block: transport_pb2.TransportConfig) -> Literal["auto", "zenoh", "dds"]:
    if block.kind == transport_pb2.TRANSPORT_ZENOH:
        return "zenoh"
    return "dds" if block.kind == transport_pb2.TRANSPORT_DDS else "auto"


def _tls(block: transport_pb2.TransportConfig, folder: Path) -> TlsSpec | None:
    if not block.HasField("tls"):
        return None
    return TlsSpec(
        root_ca_file=str((folder / block.tls.root_ca_file).absolute()),
        certificate_file=str((folder / block.tls.certificate_file).absolute()),
        private_key_file=str((folder / block.tls.private_key_file).absolute()),
    )

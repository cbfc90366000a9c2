"""The transport of a plan: the file's block, else the environment, else the embedded default."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from joshua.plan import Severity, TlsSpec, TransportSettings
from joshua.transport.choice import ZENOH, TransportChoiceError, choose_transport, kind_of, why_missing

if TYPE_CHECKING:
    from joshua.planner.diagnostics import Diagnostics
    from joshua.plugins import Registry
    from joshua.schema import config_pb2 as pb
    from joshua.schema import transport_pb2

_ZENOH_FIELDS = ("listen_endpoints", "connect_endpoints", "tls")
_DDS_FIELDS = ("network_interface", "peers")


def transport_settings(
    config: pb.Config, source: str, findings: Diagnostics, registry: Registry, option: str = ""
) -> TransportSettings | None:
    """Choose the transport; an unknown value or a missing plugin becomes a finding, an unknown value None.

    Args:
        config, source: the file and its path; findings: where diagnostics go.
        registry: what is installed.
        option: value of ``--transport``.
    """
    block = config.transport
    try:
        settings = choose_transport(
            block, os.environ, lambda: registry, option=option, tls=_tls(block, source, findings)
        )
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
    _refuse_unused(block, settings, findings)
    if not settings.implementation:
        message, remedy = why_missing(settings, registry)
        severity = Severity.ERROR if findings.launch else Severity.NOTE
        findings.add(
            "extra-missing", severity, message[0].upper() + message[1:], "transport.kind", remedy=remedy
        )
    return settings


def _refuse_unused(
    block: transport_pb2.TransportConfig, settings: TransportSettings, findings: Diagnostics
) -> None:
    """Refuse settings of one transport where the environment chose the other; checks know a named kind."""
    if kind_of(block):
        return
    chosen, other = ("Zenoh", "DDS") if settings.kind == ZENOH else ("DDS", "Zenoh")
    fields = _ZENOH_FIELDS if other == "Zenoh" else _DDS_FIELDS
    written = {field.name for field, _ in block.ListFields()}
    for field in (name for name in fields if name in written):
        findings.add(
            "transport-field-unused",
            Severity.ERROR,
            f"{field} is a setting of {other}, and {chosen} was chosen: {settings.reason}",
            f"transport.{field}",
            found=field,
            remedy=f"Write kind: TRANSPORT_{other.upper()} into transport, or remove {field}",
        )


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

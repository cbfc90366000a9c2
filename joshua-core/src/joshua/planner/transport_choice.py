"""Chooses the transport of a plan: the file's block, else the environment, else the default."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import TYPE_CHECKING

from joshua.plan import Diagnostic, TlsSpec, TransportSettings
from joshua.transport.choice import ZENOH, TransportChoiceError, choose_transport, kind_of, why_missing

if TYPE_CHECKING:
    from joshua.config.checks import Context
    from joshua.plugins import Registry

_ZENOH_FIELDS = ("listen_endpoints", "connect_endpoints", "tls", "open_to_local_users")
_DDS_FIELDS = ("network_interface", "peers")


def transport_settings(
    context: Context, registry: Registry, option: str = ""
) -> tuple[TransportSettings | None, list[Diagnostic]]:
    """Choose the transport; None and the reason if the environment is invalid.

    Args:
        context: the loaded file; registry: what is installed.
        option: value of ``--transport``.
    """
    block = context.config.transport
    try:
        settings = choose_transport(
            block,
            os.environ,
            lambda: registry,
            option=option,
            tls=_tls(context) if block.HasField("tls") else None,
        )
    except TransportChoiceError as error:
        message = f"ROS 2 does not know the value of the environment variable {error.variable}"
        found = f"{error.variable}={error.found}"
        allowed, remedy = error.allowed, error.remedy
        problem = context.error("transport-environment", message, found=found, allowed=allowed, remedy=remedy)
        return None, [problem]
    problems = [] if kind_of(block) else list(_unused(context, settings))  # the checks cover an explicit kind
    if not settings.implementation:
        message, remedy = why_missing(settings, registry)
        message = message[0].upper() + message[1:]
        path = "transport.kind"
        problems.append(context.missing("extra-missing", message, path, found="", remedy=remedy))
    return settings, problems


def _unused(context: Context, settings: TransportSettings) -> Iterator[Diagnostic]:
    """Find settings of one transport if the environment selects the other."""
    chosen, other = ("Zenoh", "DDS") if settings.kind == ZENOH else ("DDS", "Zenoh")
    fields = _ZENOH_FIELDS if other == "Zenoh" else _DDS_FIELDS
    written = {field.name for field, _ in context.config.transport.ListFields()}
    for field in (name for name in fields if name in written):
        yield context.error(
            "transport-field-unused",
            f"{field} is a setting of {other}, but {chosen} was chosen: {settings.reason}",
            f"transport.{field}",
            found=field,
            remedy=f"Write kind: TRANSPORT_{other.upper()} into transport, or remove {field}",
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

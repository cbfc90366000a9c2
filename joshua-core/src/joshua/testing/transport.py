"""Settings of an installed transport, for tests that open one."""

from __future__ import annotations

from typing import Any

from joshua.plan import TransportSettings
from joshua.plugins import load_registry


def transport_settings(kind: str, **values: Any) -> TransportSettings:
    """Settings that open the transport ``kind``, such as ``dds``.

    Args:
        kind: name of an installed transport.
        values: further fields of ``TransportSettings``.

    Raises:
        KeyError: no installed plugin provides it.
    """
    spec = load_registry().transports()[kind]
    return TransportSettings(kind=kind, implementation=spec.implementation, prepare=spec.prepare, **values)

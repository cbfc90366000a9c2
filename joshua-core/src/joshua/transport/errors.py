"""Exceptions of the transport room."""

from __future__ import annotations

from typing import ClassVar


class TransportError(RuntimeError):
    """The transport cannot be opened or used as asked; the message says why and what to do."""

    exit_code: ClassVar[int] = 1


class TransportMissingError(TransportError):
    """The transport needs an extra that is not installed."""

    exit_code: ClassVar[int] = 3

"""Exceptions of the transport room."""

from __future__ import annotations


class TransportError(RuntimeError):
    """The transport cannot be opened or used as asked; the message says why and what to do."""


class TransportMissingError(TransportError):
    """The transport needs an extra that is not installed."""

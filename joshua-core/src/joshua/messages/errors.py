"""The one exception of the message room."""

from __future__ import annotations


class MessageError(ValueError):
    """A type is unknown, a message has a field that does not fit, or a payload is malformed."""

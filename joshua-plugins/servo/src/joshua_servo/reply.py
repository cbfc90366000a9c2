"""Replies on a servo bus."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, Protocol


class Reply(NamedTuple):
    """A status packet of one servo. ``error`` is the servo's error byte."""

    servo_id: int
    error: int
    data: bytes


class ReplySearch(Protocol):
    """Finds replies in received bytes. ``broken`` counts packets with a wrong checksum."""

    broken: int

    def feed(self, data: bytes) -> Iterator[Reply]:
        """Add bytes. Yield each complete reply, skipping noise."""

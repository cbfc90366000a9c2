"""What comes back over a servo bus."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, Protocol


class Reply(NamedTuple):
    """A status packet of one servo; ``error`` carries what the servo says of the request and of itself."""

    servo_id: int
    error: int
    data: bytes


class ReplySearch(Protocol):
    """Replies in received bytes; ``broken`` counts packets with a wrong checksum."""

    broken: int

    def feed(self, data: bytes) -> Iterator[Reply]:
        """Add bytes; yield each complete reply, skipping noise."""

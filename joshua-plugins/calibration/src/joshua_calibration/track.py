"""Unwrapping of one joint's encoder over time."""

from __future__ import annotations


class Track:
    """Unwraps one encoder; positions are multi-turn ticks.

    Args:
        ticks_per_turn: of the encoder.
    """

    def __init__(self, ticks_per_turn: int) -> None:
        self.ticks_per_turn = ticks_per_turn
        self.raw: int | None = None
        self.position = 0

    def follow(self, raw: int) -> None:
        """Add a reading; the joint has moved less than half a turn since the last one."""
        self.position += self._shortest(raw - self.raw) if self.raw is not None else raw
        self.raw = raw

    def resume(self, raw: int, home: int | None) -> None:
        """Add a reading after a gap, in which the joint may have moved either way round.

        Args:
            home: position of the middle pose, less than half a turn away; None if unknown.
        """
        around = self.position if home is None else home
        self.position = around + self._shortest(raw - around)
        self.raw = raw

    def _shortest(self, ticks: int) -> int:
        """Wrap an angle to half a turn to either side of zero."""
        half = self.ticks_per_turn // 2
        return (ticks + half) % self.ticks_per_turn - half

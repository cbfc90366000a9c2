"""One joint's encoder over time: a position that continues where the encoder starts again at zero."""

from __future__ import annotations


class Track:
    """Follows one encoder; positions are ticks that do not wrap.

    Args:
        ticks_per_turn: of the encoder.
    """

    def __init__(self, ticks_per_turn: int) -> None:
        self.ticks_per_turn = ticks_per_turn
        self.raw: int | None = None
        self.position = 0

    def follow(self, raw: int) -> None:
        """Take the next reading; the joint has moved less than half a turn since the last one."""
        self.position += self._shortest(raw - self.raw) if self.raw is not None else raw
        self.raw = raw

    def resume(self, raw: int, home: int | None) -> None:
        """Take a reading after a pause, in which the joint may have gone either way round.

        Args:
            home: position of the middle pose, which is less than half a turn away; None while it is unknown.
        """
        around = self.position if home is None else home
        self.position = around + self._shortest(raw - around)
        self.raw = raw

    def _shortest(self, ticks: int) -> int:
        """The same angle in the half turn to either side of zero."""
        half = self.ticks_per_turn // 2
        return (ticks + half) % self.ticks_per_turn - half

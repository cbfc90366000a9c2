"""Figures of a running scanner."""

from __future__ import annotations

import statistics
from collections import deque
from dataclasses import dataclass

_WINDOW = 50

#: Damaged places as share of the packets above which a line is not in order.
DAMAGED_SHARE = 0.01


@dataclass(frozen=True)
class Figures:
    """Figures since the scanner was opened.

    Attributes:
        turn_hz: turns per second, median of the last ones; 0 before the first.
        points: measurements of a turn, median of the last ones.
        coverage: share of the beams that measured something, or say that nothing is in reach; of the last
            scans, 0 to 1.
        turns: complete turns; packets: accepted; damaged: places of the stream that were left out.
    """

    turn_hz: float
    points: int
    coverage: float
    turns: int
    packets: int
    damaged: int

    def line(self) -> str:
        """One line for people."""
        return (
            f"{self.turn_hz:.1f} turns a second, {self.points} points a turn, "
            f"{self.coverage:.0%} of the beams measured, {self.packets} packets, {self.damaged} damaged"
        )


class FigureKeeper:
    """Collects the figures."""

    def __init__(self) -> None:
        self.turns = self.packets = self.damaged = 0
        self._turn_s: deque[float] = deque(maxlen=_WINDOW)
        self._points: deque[int] = deque(maxlen=_WINDOW)
        self._coverage: deque[float] = deque(maxlen=_WINDOW)

    def add(self, turn_s: float, points: int, coverage: float) -> None:
        """Count one turn."""
        self.turns += 1
        self._turn_s.append(turn_s)
        self._points.append(points)
        self._coverage.append(coverage)

    def figures(self) -> Figures:
        """The figures now."""
        if not self.turns:
            return Figures(0.0, 0, 0.0, 0, self.packets, self.damaged)
        return Figures(
            turn_hz=1.0 / statistics.median(self._turn_s),
            points=round(statistics.median(self._points)),
            coverage=statistics.fmean(self._coverage),
            turns=self.turns,
            packets=self.packets,
            damaged=self.damaged,
        )

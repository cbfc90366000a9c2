"""Statistics of a running scanner."""

from __future__ import annotations

import statistics
from collections import deque
from dataclasses import dataclass

_WINDOW = 50

#: Share of damaged packets above which a line is reported as faulty.
DAMAGED_SHARE = 0.01


@dataclass(frozen=True)
class Figures:
    """Statistics since the scanner was opened.

    Attributes:
        turn_hz: turns per second, median of recent turns; 0 before the first.
        points: measurements per turn, median of recent turns.
        coverage: share of beams with a measurement or with nothing in range, over recent scans, 0 to 1.
        turns: complete turns; packets: accepted; damaged: skipped parts of the stream.
    """

    turn_hz: float
    points: int
    coverage: float
    turns: int
    packets: int
    damaged: int

    def line(self) -> str:
        """Return the statistics as one line of text."""
        return (
            f"{self.turn_hz:.1f} turns a second, {self.points} points a turn, "
            f"{self.coverage:.0%} of the beams measured, {self.packets} packets, {self.damaged} damaged"
        )


class FigureKeeper:
    """Collects the statistics."""

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
        """Return the present statistics."""
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

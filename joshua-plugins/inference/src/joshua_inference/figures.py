"""Figures of how well a model keeps up with its arm, for the status line and the end of the run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from joshua.api import FloatArray
from joshua.api.nodes import DurationHistogram


@dataclass(frozen=True)
class InferenceFigures:
    """Figures since the start.

    Attributes:
        rate_hz: of the actions, measured; chunks: predicted; queue: steps left in the newest one.
        latency_p50_s, latency_p99_s: the model's own time for a chunk; overhead_p50_s: from the start of
            an observation to its chunk in the queue, without the model's own time.
        age_p50_s, age_p99_s: of the observation behind an action when it is published.
        reaction_p50_s, reaction_p99_s: the same of the first action of each chunk.
        periods, gaps: since the first action, and how many of them had none.
        skipped: steps that were late when their chunk arrived.
        borders: chunks that followed another one.
        border_rad, border_rad_s: largest difference of a new chunk from the plan before it, and largest
            change of speed there; border_mean_rad: the mean of all borders.
        episodes, successes: of those that have ended.
        state: of the model, such as ``acts`` or ``paused``.
    """

    rate_hz: float
    chunks: int
    queue: int
    latency_p50_s: float
    latency_p99_s: float
    overhead_p50_s: float
    age_p50_s: float
    age_p99_s: float
    reaction_p50_s: float
    reaction_p99_s: float
    periods: int
    gaps: int
    skipped: int
    borders: int
    border_rad: float
    border_mean_rad: float
    border_rad_s: float
    episodes: int = 0
    successes: int = 0
    state: str = ""

    def __str__(self) -> str:
        return (
            f"{self.rate_hz:.3g} Hz, queue {self.queue}, model {1e3 * self.latency_p50_s:.3g}/"
            f"{1e3 * self.latency_p99_s:.3g} ms, age {self.age_p50_s:.2f} s, skipped {self.skipped}, "
            f"border {self.border_rad:.2g} rad {self.border_rad_s:.2g} rad/s"
        )


class FigureKeeper:
    """Collects the figures; the loop holds its lock."""

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self.latency, self.overhead, self.age, self.reaction = (DurationHistogram() for _ in range(4))
        self.periods = self.gaps = self.skipped = self._borders = 0
        self._actions = self._playing_ns = self._last_ns = 0
        self.episodes = self.successes = 0
        self._jump = self._jump_sum = self._change = 0.0

    def period(self, now_ns: int, *, counts: bool, gap: bool) -> None:
        """Count a period; ``counts``: an action was expected, ``gap``: there was none."""
        self.periods += counts
        self.gaps += counts and gap
        if counts and self._last_ns:
            self._playing_ns += now_ns - self._last_ns
            self._actions += not gap
        self._last_ns = now_ns if counts else 0

    def border(self, due: FloatArray, planned: FloatArray, before: list[FloatArray]) -> None:
        """Count a border: the first action of a chunk, what was planned, the two published before it."""
        jump = float(np.abs(due - planned).max())
        self._borders += 1
        self._jump, self._jump_sum = max(self._jump, jump), self._jump_sum + jump
        if len(before) == 2:
            change = np.abs(due - 2 * before[1] + before[0]).max() / self._period_s
            self._change = max(self._change, float(change))

    def figures(self, queue: int) -> InferenceFigures:
        """Return the figures so far."""
        return InferenceFigures(
            rate_hz=1e9 * self._actions / self._playing_ns if self._playing_ns > 0 else 0.0,
            chunks=self.latency.count,
            queue=queue,
            latency_p50_s=self.latency.quantile_ns(0.5) / 1e9,
            latency_p99_s=self.latency.quantile_ns(0.99) / 1e9,
            overhead_p50_s=self.overhead.quantile_ns(0.5) / 1e9,
            age_p50_s=self.age.quantile_ns(0.5) / 1e9,
            age_p99_s=self.age.quantile_ns(0.99) / 1e9,
            reaction_p50_s=self.reaction.quantile_ns(0.5) / 1e9,
            reaction_p99_s=self.reaction.quantile_ns(0.99) / 1e9,
            periods=self.periods,
            gaps=self.gaps,
            skipped=self.skipped,
            borders=self._borders,
            border_rad=self._jump,
            border_mean_rad=self._jump_sum / max(1, self._borders),
            border_rad_s=self._change,
            episodes=self.episodes,
            successes=self.successes,
        )

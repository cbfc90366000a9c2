"""How chunks of actions follow one another: pure, in steps of the publisher's period."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from joshua.api import FloatArray
from joshua.api.models import ChunkRequest, Execution


@dataclass(frozen=True, eq=False)
class Chunk:
    """Actions, shape (T, N), from the step ``first`` on; ``stamp_ns`` is that of their observation."""

    first: int
    actions: FloatArray
    stamp_ns: int = 0

    @property
    def end(self) -> int:
        """First step after the chunk."""
        return self.first + len(self.actions)

    def at(self, step: int) -> FloatArray | None:
        """Return the action of a step; None outside the chunk."""
        return self.actions[step - self.first] if self.first <= step < self.end else None


class Strategy:
    """REPLACE_ON_ARRIVAL, and the base of the others.

    Attributes:
        chunk: the newest one. on_arrival: chunks begin when they arrive, because the arm has held meanwhile.
    """

    on_arrival = False

    def __init__(self, execution: Execution) -> None:
        self.execution = execution
        self.chunk: Chunk | None = None

    def add(self, chunk: Chunk, step: int) -> None:
        """Add a chunk before ``step`` is due; one whose steps have all passed is dropped."""
        if chunk.end > step:
            self.chunk = chunk

    def due(self, step: int) -> FloatArray | None:
        """Return the action of a step; None if no chunk has one."""
        return self.chunk.at(step) if self.chunk is not None else None

    def wants(self, step: int, delay: int) -> bool:
        """Return whether to predict a chunk that arrives ``delay`` steps after its observation."""
        if self.chunk is None:
            return True
        after = self.execution.steps_per_chunk or max(1, len(self.chunk.actions) // 2)
        return step >= min(self.chunk.first + after, self.chunk.end - delay)

    def request(self, first: int, delay: int) -> ChunkRequest | None:
        """Return what a chunk observed at the step ``first`` must continue; None for nothing."""
        del first, delay  # for real-time chunking
        return None

    def clear(self) -> None:
        """Drop every chunk."""
        self.chunk = None


class Ensemble(Strategy):
    """TEMPORAL_ENSEMBLE: the mean of all chunks that have the step, weighted as in ACT (Zhao et al. 2023)."""

    def __init__(self, execution: Execution) -> None:
        super().__init__(execution)
        self._chunks: deque[Chunk] = deque(maxlen=1000)

    def add(self, chunk: Chunk, step: int) -> None:
        """Add a chunk beside those that still have steps."""
        super().add(chunk, step)
        self._chunks = deque((own for own in (*self._chunks, chunk) if own.end > step), maxlen=1000)

    def due(self, step: int) -> FloatArray | None:
        """Return the weighted mean: the oldest chunk weighs 1, the i-th after it exp(-coefficient · i)."""
        rows = [row for row in (chunk.at(step) for chunk in self._chunks) if row is not None]
        if not rows:
            return None
        weights = np.exp(-self.execution.ensemble_coefficient * np.arange(len(rows)))
        mean: FloatArray = weights @ np.array(rows) / weights.sum()
        return mean

    def wants(self, step: int, delay: int) -> bool:
        """Return True after each step, or after the number of steps in the file."""
        return self.chunk is None or step >= self.chunk.first + (self.execution.steps_per_chunk or 1)

    def clear(self) -> None:
        """Drop every chunk."""
        super().clear()
        self._chunks.clear()


class RealTimeChunking(Strategy):
    """REAL_TIME_CHUNKING (Black, Galliker, Levine 2025): a chunk continues the one before it."""

    def request(self, first: int, delay: int) -> ChunkRequest | None:
        """Return the actions planned from ``first`` on, of which ``delay`` are executed in any case."""
        chunk, execution = self.chunk, self.execution
        if chunk is None or chunk.at(first) is None:
            return None
        planned = chunk.actions[first - chunk.first :].copy()
        fixed = min(delay, len(planned))
        # by default all that the observation leaves of the plan: H - s of the paper, s as it was executed
        overlap = min(max(execution.execution_horizon or len(planned), fixed), len(planned))
        schedule = execution.guidance_schedule.removeprefix("GUIDANCE_").lower()
        return ChunkRequest(planned, fixed, overlap, execution.max_guidance_weight, schedule)


class Synchronous(Strategy):
    """SYNCHRONOUS: the next chunk is predicted after one has been executed, and begins when it arrives."""

    on_arrival = True

    def wants(self, step: int, delay: int) -> bool:
        """Return True at the end of a chunk, or of the steps of it that the file executes."""
        return self.due(step) is None

    def add(self, chunk: Chunk, step: int) -> None:
        """Keep as many steps as the file executes."""
        count = self.execution.steps_per_chunk or len(chunk.actions)
        super().add(Chunk(chunk.first, chunk.actions[:count], chunk.stamp_ns), step)


STRATEGIES = {
    "REPLACE_ON_ARRIVAL": Strategy,
    "TEMPORAL_ENSEMBLE": Ensemble,
    "REAL_TIME_CHUNKING": RealTimeChunking,
    "SYNCHRONOUS": Synchronous,
}


class Output:
    """Turns the action that is due into the published one: ramps around a hold, and the speed limit.

    Args:
        period_s: of the publisher; execution: the length of the ramp, and the largest speed.

    Attributes:
        last: last published action; None before the first one, and after publishing has ended.
    """

    def __init__(self, period_s: float, execution: Execution) -> None:
        self._ramp = round(execution.ramp_s / period_s)
        self._most = execution.max_velocity_rad_s * period_s or np.inf
        self.forget()

    def forget(self) -> None:
        """Start again: the actuator itself approaches the next published action."""
        self.last: FloatArray | None = None
        self._due: FloatArray | None = None
        self._velocity: FloatArray | float = 0.0
        self._hold: FloatArray | None = None
        self._idle = self._back = self._length = 0

    def next(self, due: FloatArray | None, *, border: bool = False, keep: bool = True) -> FloatArray | None:
        """Return the action to publish in this period.

        Args:
            due: None stops over the length of the ramp.
            border: it is the first action of another chunk, which gives no speed.
            keep: publish a hold after the ramp; else nothing.
        """
        if due is None:
            self._due = None
            if self.last is not None and self._idle >= self._ramp and not keep:
                self.forget()
            if self.last is None:
                return None
            self._idle += 1
            slower = max(0.0, 1 - self._idle / self._ramp) ** 2 if self._ramp else 0.0
            return self._limited(self.last + self._velocity * slower)
        self._velocity = due - self._due if self._due is not None and not border else self._velocity
        if self._idle:  # back from a hold, over as many steps as it lasted
            self._hold, self._back, self._length = self.last, 0, min(self._idle, self._ramp)
            self._velocity, self._idle = np.zeros_like(due), 0
        self._due = wanted = due
        if self._back < self._length and self._hold is not None:
            self._back += 1
            part = self._back / (self._length + 1)
            wanted = self._hold + (3 - 2 * part) * part**2 * (due - self._hold)
        return self._limited(wanted)

    def _limited(self, wanted: FloatArray) -> FloatArray:
        if self.last is not None:
            limited = self.last + np.clip(wanted - self.last, -self._most, self._most)
            wanted = np.where(np.abs(wanted - self.last) <= self._most, wanted, limited)
        self.last = wanted
        return wanted

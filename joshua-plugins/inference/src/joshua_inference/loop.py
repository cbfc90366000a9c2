"""Concurrent observation, model and action: none of them waits for another."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable

import numpy as np
from joshua.api import FloatArray, JointSpace, Model, ModelError, Observation
from joshua.api.models import Execution

from joshua_inference.figures import FigureKeeper, InferenceFigures
from joshua_inference.strategies import STRATEGIES, Chunk, Output

#: Distance beyond a limit from which an action of a model is reported. A trained model misses it by less.
_REPORTED_BEYOND_RAD = 0.1

#: Number of latencies whose longest is expected for the next chunk.
_DELAYS = 10


class InferenceLoop:
    """Placement of a model's chunks on the time axis of a timer.

    Steps count the periods of the timer from its first tick on. Step k of a chunk belongs to the tick that is
    nearest to the stamp of the observation plus k periods.

    Args:
        execution: of the file; joints: commanded ones; period_s: of the timer.
        now_ns: the clock of the stamps.

    Attributes:
        outside: joints that the model has commanded far outside their limits, with the first such position
            in rad.
    """

    def __init__(
        self, execution: Execution, joints: JointSpace, period_s: float, now_ns: Callable[[], int]
    ) -> None:
        self._execution, self.joints, self._now_ns = execution, joints, now_ns
        self.took_s = 0.0  # the model's time for the last chunk
        self.outside: dict[str, float] = {}
        self._period_ns = round(period_s * 1e9)
        self._strategy = STRATEGIES[execution.strategy](execution)
        self._output = Output(period_s, execution)
        self._lock = threading.Lock()
        self._wanted = threading.Event()
        self._keeper = FigureKeeper(period_s)
        self._delays: deque[int] = deque(maxlen=_DELAYS)
        self._before: deque[FloatArray] = deque(maxlen=2)
        self._origin_ns: int | None = None
        self._next = self._epoch = 0
        self._asked = -1  # the step of the last prediction: one in each step at most
        self._called_ns = 0
        self._playing: Chunk | None = None
        self._begun = self._single = self._hurry = False
        self._mark: bool | None = None  # of the episode that has ended last, until the next one begins
        self.paused = False

    def wait(self, timeout_s: float) -> bool:
        """Wait until a chunk is wanted; return False after the timeout; on the model's thread."""
        with self._lock:
            self._wanted.clear()
            if self._wants():
                return True
        return self._wanted.wait(timeout_s)

    def predict(self, model: Model, observation: Observation, began_ns: int = 0) -> int:
        """Run the model on an observation; on the model's thread.

        Args:
            began_ns: when the work on the observation began, monotonic; 0 for now.

        Returns:
            The number of late steps of the chunk. Raises ModelError for actions that cannot be sent.
        """
        began_ns = began_ns or time.monotonic_ns()
        with self._lock:
            if self._rests():  # paused since the model was asked
                return 0
            known = self._strategy.chunk
            again = known is not None and known.stamp_ns == observation.stamp_ns and not self._hurry
            epoch, self._hurry, self._asked = self._epoch, False, self._next
            if again and known is not None and len(known.actions) > 1 and not self._strategy.on_arrival:
                return 0  # the same observation gives the same chunk
            first = self._step(observation.stamp_ns)
            request = self._strategy.request(first, self._delay())
        self._called_ns = called_ns = time.monotonic_ns()
        act = model.act(observation) if request is None else model.continue_chunk(observation, request)
        took_ns, self._called_ns = time.monotonic_ns() - called_ns, 0
        self.took_s = took_ns / 1e9
        actions = checked(act, self.joints, type(model).__name__)
        self.outside = {**outside(act, self.joints), **self.outside}
        with self._lock:
            if epoch != self._epoch:  # its chunk is not valid any more
                return 0
            self._delays.append(max(1, self._next - first))
            if (
                self._strategy.on_arrival or len(actions) == 1
            ):  # the arm holds, or the model acts on the present
                first = self._next
            late = min(len(actions), max(0, self._next - first))
            self._keeper.skipped += late
            self._strategy.add(Chunk(first, actions, observation.stamp_ns), self._next)
            self._keeper.latency.add(took_ns)
            self._keeper.overhead.add(time.monotonic_ns() - began_ns - took_ns)
        return late

    def tick(self, *, runs: bool, keep: bool) -> FloatArray | None:
        """Return the action to publish, None for none; on the timer's thread.

        Args:
            runs: actions are executed; else the arm ramps to a stop.
            keep: the hold after the ramp is published.
        """
        now_ns = self._now_ns()
        with self._lock:
            step = self._step(now_ns)
            self._next = step + 1
            due = self._strategy.due(step) if runs and (not self.paused or self._single) else None
            if self._single and due is None and self._strategy.chunk is not None:
                self._single = False  # executed
            chunk, border = self._strategy.chunk, False
            if due is not None and chunk is not None:
                begins = chunk is not self._playing
                border = self._is_border(step, due, chunk)
                self._keeper.age.add(now_ns - chunk.stamp_ns)
                if begins:
                    self._keeper.reaction.add(now_ns - chunk.stamp_ns)
            action = self._output.next(due, border=border, keep=keep)
            if action is not None:
                self._before.append(action)
            self._begun = (self._begun or due is not None) and runs
            self._keeper.period(now_ns, counts=self._begun and not self.paused, gap=due is None)
            if runs and self._wants():
                self._wanted.set()
        return action

    def pause(self) -> None:
        """Ramp to a stop and hold."""
        with self._lock:
            self.paused, self._single = True, False
            self._forget()

    def resume(self) -> None:
        """Continue with a new chunk."""
        with self._lock:
            self.paused = self._single = False
            self._mark = None
            self._forget()

    def single(self) -> None:
        """Execute one chunk, then hold again."""
        with self._lock:
            self._forget()
            self.paused = self._single = True
            self._mark = None

    def hurry(self) -> None:
        """Request a chunk at once, because the task has changed."""
        with self._lock:
            self._hurry = True
            self._wanted.set()

    def clear(self, *, output: bool = False) -> None:
        """Drop what is planned and what is being computed; ``output``: what was published, too."""
        with self._lock:
            self._forget()
            if output:
                self._output.forget()

    def end_episode(self, success: bool) -> int:
        """Count an episode, or mark the last one again. Returns how many have ended."""
        self.pause()
        self._keeper.episodes += self._mark is None
        self._keeper.successes += success - bool(self._mark)
        self._mark = success
        return self._keeper.episodes

    @property
    def computing_s(self) -> float:
        """Return how long the model has been computing its present chunk; 0 if it computes none."""
        called_ns = self._called_ns
        return (time.monotonic_ns() - called_ns) / 1e9 if called_ns else 0.0

    def figures(self) -> InferenceFigures:
        """Return the figures so far."""
        with self._lock:
            chunk = self._strategy.chunk
            return self._keeper.figures(max(0, chunk.end - self._next) if chunk is not None else 0)

    def _forget(self) -> None:
        self._strategy.clear()
        self._playing = None
        self._epoch, self._asked = self._epoch + 1, -1

    def _rests(self) -> bool:
        """Whether a pause keeps the model from acting."""
        return self.paused and not (self._single and self._strategy.chunk is None)

    def _wants(self) -> bool:
        if self._rests():
            return False
        wants = self._strategy.wants(self._next, self._delay()) and self._next > self._asked
        return self._hurry or wants

    def _is_border(self, step: int, due: FloatArray, chunk: Chunk) -> bool:
        """Return whether another chunk starts, and count how it differs from the plan before it."""
        before, self._playing = self._playing, chunk
        if before is chunk or self._execution.strategy == "TEMPORAL_ENSEMBLE":
            return False
        planned = before.at(step) if before is not None else None
        if planned is None and self._before:
            planned = self._before[-1]
        if planned is not None:
            self._keeper.border(due, planned, list(self._before))
        return True

    def _delay(self) -> int:
        """Return the expected number of steps from the next observation to its chunk."""
        if self._execution.inference_delay is not None:
            return self._execution.inference_delay
        return max(self._delays, default=0) + self._execution.delay_margin

    def _step(self, stamp_ns: int) -> int:
        if self._origin_ns is None:
            self._origin_ns = self._now_ns()
        return math.floor((stamp_ns - self._origin_ns) / self._period_ns + 0.5)


def checked(actions: FloatArray, joints: JointSpace, name: str) -> FloatArray:
    """Clip a model's actions to the limits. Raises ModelError for any other shape, or NaN."""
    chunk, count = np.asarray(actions, np.float64), len(joints.names)
    if chunk.ndim != 2 or chunk.shape[0] < 1 or chunk.shape[1] != count:
        raise ModelError(
            f"{name}.act returned shape {chunk.shape}; {count} joints need (T, {count}), T ≥ 1",
            is_permanent=True,
        )
    if not np.isfinite(chunk).all():
        raise ModelError(
            f"{name}.act returned a value that is not finite: nothing is sent to the joints. Its weights may "
            "be damaged: run another checkpoint",
            is_permanent=True,
        )
    return np.clip(chunk, joints.position_min_rad, joints.position_max_rad)


def outside(actions: FloatArray, joints: JointSpace) -> dict[str, float]:
    """Return the joints that checked actions command far outside their limits, with the furthest position."""
    chunk = np.asarray(actions, np.float64)
    beyond = np.maximum(joints.position_min_rad - chunk, chunk - joints.position_max_rad)
    if beyond.max() <= _REPORTED_BEYOND_RAD:
        return {}
    furthest = beyond.argmax(axis=0)
    return {
        name: float(chunk[furthest[index], index])
        for index, name in enumerate(joints.names)
        if beyond[furthest[index], index] > _REPORTED_BEYOND_RAD
    }

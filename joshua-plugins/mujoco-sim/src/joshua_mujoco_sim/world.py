"""The world of a physics process: a stepping thread, and hooks for devices.

The simulated actuators and cameras of one file run in one process (``process_group``) and share the world
returned by ``shared_world``. The last device to leave ends it.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from joshua_mujoco_sim.model_file import Attachment, load_model
from joshua_mujoco_sim.physics import DivergenceError, Physics
from joshua_mujoco_sim.variation import Variation

#: Shortest sleep of the stepping thread.
TICK_S = 0.001

#: Longest lag that is caught up; beyond it the clock is reset, so a stall causes no burst.
LARGEST_LAG_S = 0.1

#: A model that cannot be simulated diverges again after each reset, thousands of times.
DIVERGENCES_KEPT = 100

Hook = Callable[[Physics], None]


class Pacer:
    """Computes the due steps so that simulated time runs ``factor`` times as fast as the clock.

    Args:
        timestep_s: simulated time of one step.
        factor: 1 means real time; 0 means as fast as possible.
        clock: seconds, monotonic.

    Attributes:
        dropped_s: simulated time that was skipped because the machine was too slow.
    """

    def __init__(
        self, timestep_s: float, factor: float = 1.0, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._timestep_s = timestep_s
        self.factor = factor
        self._clock = clock
        self.dropped_s = 0.0
        self.restart()

    def restart(self) -> None:
        """Restart counting now, as after a pause."""
        self._origin_s = self._clock()
        self._steps = 0

    def due(self) -> int:
        """Return the number of due steps; without a factor always one chunk of 1/60 s."""
        if self.factor <= 0:
            return max(1, round(1 / 60 / self._timestep_s))
        wanted = int((self._clock() - self._origin_s) * self.factor / self._timestep_s + 1e-9)
        due = wanted - self._steps
        largest = max(1, int(LARGEST_LAG_S * self.factor / self._timestep_s))
        if due > largest:
            self.dropped_s += (due - largest) * self._timestep_s
            self._steps += due - largest
            due = largest
        self._steps += due
        return due

    def wait_s(self) -> float:
        """Return the wall time until the next step is due; 0 if one is due."""
        if self.factor <= 0:
            return 0.0
        next_s = self._origin_s + (self._steps + 1) * self._timestep_s / self.factor
        return max(0.0, next_s - self._clock())


@dataclass(frozen=True)
class WorldSettings:
    """Settings of a world.

    Attributes:
        model_path: packaged name or path; folder: base of relative paths.
        keyframe: initial state; "" for ``home``.
        real_time_factor: 1 means real time, 0 means as fast as possible.
        reset_on_divergence: reset instead of ending with an error.
        attached: additional models in the scene.
        variation: varies the scene at each start; None leaves it unchanged.
        shadows: cameras render them.
    """

    model_path: str
    folder: str = ""
    keyframe: str = ""
    real_time_factor: float = 1.0
    reset_on_divergence: bool = True
    attached: tuple[Attachment, ...] = ()
    variation: Variation | None = None
    shadows: bool = True


class World:
    """A running model, stepped by its own thread under ``lock``.

    Attributes:
        physics: model and state; access it only while holding ``lock``.
        lock: held by the thread while it steps.
        failure: why the world stopped by itself; "" otherwise.
        divergences: divergences that were reset, the first ``DIVERGENCES_KEPT`` of them.
        divergence_count: total number.
        demonstrator: None without one; the simulator's node offers its verbs.
    """

    def __init__(self, settings: WorldSettings) -> None:
        folder = Path(settings.folder) if settings.folder else None
        self.settings = settings
        self.physics = Physics(
            load_model(settings.model_path, folder, settings.attached),
            keyframe=settings.keyframe,
            variation=settings.variation,
        )
        self.lock = threading.RLock()
        self.failure = ""
        self.divergences: list[str] = []
        self.divergence_count = 0
        self.demonstrator: object | None = None
        self._pacer = Pacer(self.physics.timestep_s, settings.real_time_factor)
        self._jobs: deque[Callable[[], None]] = deque()
        self._jobs_lock = threading.RLock()
        self._before: list[Hook] = []
        self._after: list[Hook] = []
        self._paused = False
        self._epoch = 0  # steps that were due before a pause are not due after it
        self._steps_left = 0
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._started_s = 0.0
        self._simulated_s = 0.0
        self._asked: tuple[float, float] | None = None

    def before_step(self, hook: Hook) -> Callable[[], None]:
        """Call ``hook`` under the lock before each step. Return a function that removes it."""
        return self._hooked(self._before, hook, len(self._before))

    def after_step(self, hook: Hook, *, first: bool = False) -> Callable[[], None]:
        """Call a fast ``hook`` under the lock after each step. Return a function that removes it.

        Args:
            hook: to call; first: before all present hooks.
        """
        return self._hooked(self._after, hook, 0 if first else len(self._after))

    def defer(self, job: Callable[[], None]) -> None:
        """Run a job on the stepping thread before its next step, without the lock.

        For long jobs such as rendering: the physics waits, but devices can still read and command.
        """
        self._jobs.append(job)

    def call(self, job: Callable[[], None]) -> None:
        """Run a job on the stepping thread and wait for it."""
        done = threading.Event()

        def run() -> None:
            try:
                job()
            finally:
                done.set()

        self.defer(run)
        while not done.wait(0.1) and not self._stop.is_set():
            pass

    @contextlib.contextmanager
    def quiet(self) -> Iterator[None]:
        """Hold the lock while no deferred job runs."""
        with self._jobs_lock, self.lock:
            yield

    def start(self) -> None:
        """Start stepping. Idempotent."""
        if self._thread is not None:
            return
        self._started_s = time.monotonic()
        self._pacer.restart()
        self._thread = threading.Thread(target=self._run, name="physics", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the thread. Idempotent."""
        self._stop.set()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join()

    @property
    def paused(self) -> bool:
        """Whether time is paused."""
        return self._paused

    def pause(self) -> None:
        """Pause time; no step runs after the return."""
        with self.lock:
            self._paused = True
            self._epoch += 1

    def resume(self) -> None:
        """Resume time."""
        with self.lock:
            self._paused = False
            self._epoch += 1
            self._pacer.restart()

    def step_paused(self, count: int) -> None:
        """Run some steps while paused."""
        with self.lock:
            self._steps_left += count

    def reset(self) -> None:
        """Reset the model to its start."""
        with self.lock:
            self.physics.reset()

    @property
    def real_time_factor(self) -> float:
        """Simulated time per wall time since the start."""
        elapsed_s = time.monotonic() - self._started_s
        return self._simulated_s / elapsed_s if elapsed_s > 0 else 0.0

    def recent_real_time_factor(self) -> float:
        """Return simulated time per wall time since the last call."""
        now_s, simulated_s = time.monotonic(), self._simulated_s
        asked_s, then_s = self._asked or (self._started_s, 0.0)
        self._asked = (now_s, simulated_s)
        return (simulated_s - then_s) / (now_s - asked_s) if now_s > asked_s else 0.0

    def _run(self) -> None:
        while not self._stop.is_set():
            self._do_jobs()
            due, epoch = self._due()
            if due:
                while due > 0 and not self._stop.is_set():
                    with self.lock:
                        due -= self._steps(due) if epoch == self._epoch else due
                    self._do_jobs()
                if self.settings.real_time_factor <= 0:
                    time.sleep(0)  # lets other threads take the lock
                continue
            self._stop.wait(max(TICK_S / 2, min(self._pacer.wait_s(), 0.02)) if not self._paused else 0.005)

    def _due(self) -> tuple[int, int]:
        """Return the number of due steps and their epoch."""
        with self.lock:
            if not self._paused:
                return self._pacer.due(), self._epoch
            due, self._steps_left = self._steps_left, 0
            return due, self._epoch

    def advance(self, count: int) -> None:
        """Run steps at once with all hooks and deferred jobs. The caller holds ``lock``."""
        self._do_jobs()
        while count > 0 and not self.failure:
            count -= self._steps(count)
            self._do_jobs()

    def _do_jobs(self) -> None:
        with self._jobs_lock:
            while self._jobs:
                self._jobs.popleft()()

    def _steps(self, count: int) -> int:
        """Run up to ``count`` steps until a job is deferred. Return how many. The caller holds the lock."""
        physics = self.physics
        done = 0
        try:
            if not self._before and not self._after and not self._jobs:
                physics.step(count)
                done = count
            while done < count and not self._jobs:
                for hook in tuple(self._before):
                    hook(physics)
                physics.step_unchecked()
                for hook in tuple(self._after):
                    hook(physics)
                done += 1
            self._simulated_s += done * physics.timestep_s
            physics.check()
        except DivergenceError as error:
            self.divergence_count += 1
            if len(self.divergences) < DIVERGENCES_KEPT:
                self.divergences.append(str(error))
            if self.settings.reset_on_divergence:
                physics.reset()
            else:
                self.failure = str(error)
                self._stop.set()
            return count
        return done

    def _hooked(self, hooks: list[Hook], hook: Hook, index: int) -> Callable[[], None]:
        def remove() -> None:
            with self.lock:
                if hook in hooks:
                    hooks.remove(hook)

        with self.lock:
            hooks.insert(index, hook)
        return remove


_shared: dict[WorldSettings, tuple[World, int]] = {}
_shared_lock = threading.Lock()


def shared_world(settings: WorldSettings) -> World:
    """Return the world of this process for these settings, created on first use; leave it by ``leave_world``.

    Raises:
        ModelError: the model cannot be loaded.
    """
    with _shared_lock:
        world, users = _shared.get(settings, (None, 0))
        if world is None:
            world = World(settings)
        _shared[settings] = (world, users + 1)
        return world


def leave_world(world: World) -> None:
    """Leave a shared world; the last device closes it."""
    with _shared_lock:
        held, users = _shared.get(world.settings, (world, 1))
        if held is not world:
            return
        if users > 1:
            _shared[world.settings] = (world, users - 1)
            return
        _shared.pop(world.settings, None)
    world.close()

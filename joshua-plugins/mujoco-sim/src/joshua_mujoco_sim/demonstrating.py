"""A scripted demonstrator as the leader of a run, with full knowledge of the scene."""

from __future__ import annotations

import math
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Annotated, Any

import mujoco
import numpy as np
from joshua.api import RefusedError, verb
from pydantic import Field

from joshua_mujoco_sim.envs.experts import AFTER_STEPS, EXPERTS
from joshua_mujoco_sim.envs.state import FloatArray, IntArray, SingleState
from joshua_mujoco_sim.envs.tasks import TASKS
from joshua_mujoco_sim.envs.terms import Evaluator
from joshua_mujoco_sim.physics import Physics
from joshua_mujoco_sim.world import World

#: Simulated time for the follower to settle at the start of a scene, at least and at most.
SETTLE_S, LONGEST_SETTLE_S = 0.6, 3.0

#: Distance from the start at which the follower has settled.
SETTLED_RAD = 0.02

_ONLY = np.zeros(1, np.int64)


@dataclass(frozen=True)
class Scene:
    """Seed of a scene; the same seed gives the same scene."""

    seed: Annotated[int, Field(ge=0)] = 0


@dataclass(frozen=True)
class Progress:
    """Phase of a demonstration: resting, settling, ready, showing, succeeded or failed."""

    phase: str
    steps: int


class _LiveState(SingleState):
    """The state of a world stepped elsewhere; its time continues when a new scene starts."""

    def __init__(self, world: World, action_size: int) -> None:
        super().__init__(world.physics.model, action_size, data=world.physics.data)

    def reset(self, ids: IntArray, keyframe: int) -> None:
        """Reset the scene to a keyframe."""
        time_s = self.data.time
        super().reset(ids, keyframe)
        self.data.time = time_s


class Demonstrator:
    """Runs the scripted demonstrator of a task in a running world, episode by episode.

    Args:
        world: that runs the task's model; task: id of the environment; noise_rad: of the goals.
        recoveries: share of the episodes that show recoveries.
    """

    def __init__(self, world: World, task: str, noise_rad: float, recoveries: float = 0.0) -> None:
        self._world, self._task = world, TASKS[task]()
        self._state = _LiveState(world, self._task.action_size)
        self._task.prepare(self._state)
        self._evaluator = Evaluator(self._task, self._state, "absolute")
        stage: Any = SimpleNamespace(state=self._state, task=self._task, features=self._evaluator.features)
        self._expert = EXPERTS[task](stage, noise_rad=noise_rad, seed=0, recoveries=recoveries)
        self._period_s = self._task.frame_skip * world.physics.timestep_s
        self._phase, self._steps, self._after, self._next_s, self._seed = "resting", 0, 0, 0.0, 0
        self._goal: FloatArray = np.array(self._state.ctrl[0])

    @property
    def goal(self) -> FloatArray:
        """Joint goals of the demonstrator, rad."""
        return self._goal

    @verb(moves=True)
    def set_scene(self, scene: Scene) -> str:
        """Start a new scene and hold the arm until a demonstration begins."""
        with self._world.lock:
            self._seed = scene.seed
            self._start_scene()
            self._phase, self._next_s = "settling", self._state.data.time + SETTLE_S
        return f"scene {scene.seed}"

    @verb(moves=True)
    def show(self) -> str:
        """Start the demonstration in the scene."""
        with self._world.lock:
            if self._phase != "ready":
                raise RefusedError(f"the demonstrator is {self._phase}: set a scene, and wait for ready")
            self._expert.reset()
            self._phase, self._steps, self._after = "showing", 0, 0
            # at the moments of a camera of its rate, so that each goal follows from what a picture shows
            periods = math.ceil(self._state.data.time / self._period_s - 1e-6)
            self._next_s = periods * self._period_s
        return "showing"

    @verb(moves=False)
    def progress(self) -> Progress:
        """Report the phase of the demonstration."""
        return Progress(self._phase, self._steps)

    def advance(self, physics: Physics) -> None:
        """Advance with simulated time (before each step, under the lock)."""
        if physics.time_s < self._next_s - 1e-9:
            return
        if self._phase == "settling":
            late = physics.time_s >= self._next_s + LONGEST_SETTLE_S - SETTLE_S
            if not late and np.abs(self._state.ctrl[0] - self._goal).max() > SETTLED_RAD:
                return
            self._start_scene()  # the follower now holds its goal at the start of the scene
            self._phase = "ready"
        elif self._phase == "showing":
            mujoco.mj_forward(physics.model, physics.data)
            self._state.step_cache.clear()
            ended, success, _ = self._evaluator.terminated()
            self._after += bool(success[0] or self._after)
            if self._after > AFTER_STEPS:
                self._phase = "succeeded"
                return
            if not self._after and (ended[0] or self._steps >= self._task.max_steps):
                self._phase = "failed"
                return
            self._goal = np.asarray(self._expert.act(), np.float64)
            self._steps += 1
            self._state.elapsed_steps += 1
            self._next_s += self._period_s

    def _start_scene(self) -> None:
        self._evaluator.reset(_ONLY, (np.random.default_rng(self._seed),))
        self._expert.scatter(self._seed)
        self._goal = np.array(self._state.ctrl[0])

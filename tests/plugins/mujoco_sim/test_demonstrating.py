"""The demonstrator of a run, step by step in a world without a clock."""

from __future__ import annotations

import numpy as np
import pytest
from joshua.api import RefusedError
from joshua_mujoco_sim.demonstrating import Demonstrator, Scene
from joshua_mujoco_sim.envs.arm_terms import LET_GO_M
from joshua_mujoco_sim.physics import Physics
from joshua_mujoco_sim.world import World, WorldSettings


class Shown:
    """A world whose servos take the goals of the demonstrator at once.

    Args:
        task: id of the environment; model: of the task.
    """

    def __init__(self, task: str, model: str) -> None:
        self.world = World(WorldSettings(model, real_time_factor=0))
        self.demonstrator = Demonstrator(self.world, task, 0.0)
        self.world.before_step(self._advance)

    def _advance(self, physics: Physics) -> None:
        self.demonstrator.advance(physics)
        physics.data.ctrl[:] = self.demonstrator.goal

    def until(self, *phases: str) -> str:
        for _ in range(20_000):
            phase = self.demonstrator.progress().phase
            if phase in phases:
                return phase
            with self.world.lock:
                self.world.advance(1)
        raise AssertionError(f"still {phase}")


def test_a_demonstration_goes_on_after_the_cube_is_placed() -> None:
    shown = Shown("joshua/SoArm100PickPlace-v0", "so_arm100/pick_place.xml")
    with pytest.raises(RefusedError, match="the demonstrator is resting: set a scene"):
        shown.demonstrator.show()
    shown.demonstrator.set_scene(Scene(3))
    shown.until("ready")
    shown.demonstrator.show()
    assert shown.until("succeeded", "failed") == "succeeded"
    data = shown.world.physics.data
    away_m = np.linalg.norm(data.site("gripper").xpos - data.site("cube").xpos)
    assert away_m > 2 * LET_GO_M  # the task succeeds at LET_GO_M
    assert np.hypot(*(data.site("goal").xpos - data.site("cube").xpos)[:2]) < 0.02


def test_goals_follow_from_the_moments_of_a_camera_of_the_same_rate() -> None:
    shown = Shown("joshua/SoArm100PickPlace-v0", "so_arm100/pick_place.xml")
    shown.demonstrator.set_scene(Scene(0))
    shown.until("ready")
    with shown.world.lock:
        shown.world.advance(7)
    shown.demonstrator.show()
    moments_s, goal = [], shown.demonstrator.goal
    while len(moments_s) < 10:
        before_s = shown.world.physics.time_s
        with shown.world.lock:
            shown.world.advance(1)
        if not np.array_equal(goal, shown.demonstrator.goal):
            moments_s.append(before_s)
            goal = shown.demonstrator.goal
    assert np.diff(moments_s) == pytest.approx(0.04)
    assert np.array(moments_s) * 25 == pytest.approx(np.round(np.array(moments_s) * 25), abs=1e-6)


def test_a_demonstration_that_does_not_succeed_in_time_fails() -> None:
    shown = Shown("joshua/SoArm100Reach-v0", "so_arm100/reach.xml")
    shown.demonstrator.set_scene(Scene(0))
    shown.until("ready")
    shown.demonstrator.show()
    shown.world.physics.data.mocap_pos[0] = (0.0, -2.0, 0.1)  # out of reach
    assert shown.until("succeeded", "failed") == "failed"
    assert shown.demonstrator.progress().steps == 75

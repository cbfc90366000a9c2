"""Errors of policies, which the demonstrator of pick-and-place shows how to recover from."""

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np

from joshua_mujoco_sim.envs import arm_terms as arm
from joshua_mujoco_sim.envs.kinematics import BASE_Y_M, radial
from joshua_mujoco_sim.envs.state import FloatArray, SingleState

#: Heights of the grip at the start, above the table, and its distance beside the cube, at most.
START_LOW_M, START_HIGH_M, START_BESIDE_M = 0.015, 0.16, 0.06

#: How often an episode begins after a grasp that missed; by how much it missed; for how many steps of 40 ms
#: it went down, and for how many the jaws have closed.
MISSES, MISSED_M, MISSED_DOWN_STEPS, MISSED_STEPS = 0.5, (0.012, 0.035), 8, (2, 14)

#: How often the cube lies elsewhere; distances from the arm's base, and angles from its front, at which it
#: may lie, as far as the camera ``work`` sees it; how often beside the goal, and its distances from the goal.
PUSHED, PUSHED_M, PUSHED_RAD = 0.6, (0.12, 0.33), 1.0
SEEN_X_M, SEEN_Y_M = 0.205, -0.335
BESIDE_GOAL, BESIDE_GOAL_M = 0.4, (0.024, 0.07)

#: Speed and turn rate, at most, at which somebody moves the cube while the jaws approach; how long, at most,
#: and the distance of the grip from the cube at which it is let go. A cube that is moved until the jaws are
#: nearer teaches policies to hover above it.
MOVED_M_S, MOVED_RAD_S = 0.2, 2.0
MOVED_S, MOVED_NEAR_M = 1.0, 0.05

#: How often the cube slips out of the closing jaws, at what speed, and for how many steps. Policies that
#: learn by L1 learn the median, so slips are rarer than grasps that succeed.
SLIPS, SLIP_M_S, SLIP_STEPS = 0.4, 0.3, (2, 4)


class LooseCube:
    """Moves the cube as policies and people do, within the reach of the arm.

    Args:
        state: of the task pick-and-place; period_s: of its steps.
    """

    def __init__(self, state: SingleState, period_s: float) -> None:
        self._state, self._period_s = state, period_s

    @property
    def place(self) -> FloatArray:
        """Where the cube is, m, shape (3,); live."""
        place: FloatArray = self._state.site("cube")[0]
        return place

    def lay(self, chance: np.random.Generator, beside_goal: bool) -> None:
        """Lay the cube flat on the table anywhere, or beside the goal."""
        state, goal = self._state, self._state.site("goal")[0, :2]
        while True:
            if beside_goal:
                radius, angle = chance.uniform(*BESIDE_GOAL_M), chance.uniform(-np.pi, np.pi)
                place = goal + radius * np.array([np.cos(angle), np.sin(angle)])
            else:
                radius, angle = chance.uniform(*PUSHED_M), chance.uniform(-PUSHED_RAD, PUSHED_RAD)
                place = np.array([radius * np.sin(angle), BASE_Y_M - radius * np.cos(angle)])
            apart_m = float(np.hypot(*(place - state.site("gripper")[0, :2])))
            if self.is_free(place, BESIDE_GOAL_M[0]) and apart_m > 2 * arm.HALF_CUBE_M:
                break
        half_turn = chance.uniform(-np.pi, np.pi) / 2
        state.qpos[0, 6:13] = *place, arm.HALF_CUBE_M, np.cos(half_turn), 0.0, 0.0, np.sin(half_turn)
        state.qvel[0, 6:12] = 0.0

    def slide(self, chance: np.random.Generator) -> Iterator[None]:
        """Move the cube until the grip is near or some time has passed, step by step.

        All directions are equally likely, so a policy cannot guess the next place.
        """
        state = self._state
        turn_rad_s = chance.uniform(-MOVED_RAD_S, MOVED_RAD_S)
        angle, speed_m_s = self._angle(chance), chance.uniform(0.3 * MOVED_M_S, MOVED_M_S)
        for _ in range(int(chance.uniform(0.0, MOVED_S) / self._period_s)):
            if np.linalg.norm(self.place - state.site("gripper")[0]) < MOVED_NEAR_M:
                return
            angle = self._move(chance, angle, speed_m_s, turn_rad_s)
            yield

    def slip(self, chance: np.random.Generator, line_rad: float) -> Iterator[None]:
        """Move the cube out of jaws that close along a line at an angle about z, step by step."""
        angle = line_rad + chance.choice((-0.5, 0.5)) * np.pi
        turn_rad_s = chance.uniform(-MOVED_RAD_S, MOVED_RAD_S)
        for _ in range(chance.integers(*SLIP_STEPS, endpoint=True)):
            angle = self._move(chance, angle, SLIP_M_S, turn_rad_s)
            yield

    def is_free(self, place: FloatArray, least_m: float) -> bool:
        """Return whether the arm reaches a place, m, shape (2,), and the goal is far enough from it."""
        radius = np.hypot(place[0], place[1] - BASE_Y_M)
        inside = PUSHED_M[0] <= radius <= PUSHED_M[1] and abs(radial(place)) <= PUSHED_RAD
        inside = inside and abs(place[0]) <= SEEN_X_M and place[1] >= SEEN_Y_M
        goal = self._state.site("goal")[0, :2]
        return bool(inside and np.hypot(*(place - goal)) >= least_m)

    def _move(self, chance: np.random.Generator, angle: float, speed_m_s: float, turn_rad_s: float) -> float:
        """Move the cube by one step; return the angle, a new one where the cube cannot go on."""
        state = self._state
        for _ in range(20):
            way = speed_m_s * self._period_s * np.array([np.cos(angle), np.sin(angle)])
            place = self.place[:2] + way
            if self.is_free(place, 2 * arm.PLACED_M):
                half_turn, turned = 0.5 * self._period_s * turn_rad_s, np.zeros(4)
                turn = np.array([np.cos(half_turn), 0.0, 0.0, np.sin(half_turn)])
                mujoco.mju_mulQuat(turned, turn, state.qpos[0, 9:13])
                state.qpos[0, 6:8], state.qpos[0, 9:13] = place, turned
                break
            angle = self._angle(chance)
        return angle

    @staticmethod
    def _angle(chance: np.random.Generator) -> float:
        return float(chance.uniform(-np.pi, np.pi))

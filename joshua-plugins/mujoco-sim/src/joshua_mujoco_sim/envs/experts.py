"""Scripted demonstrators: solve a task by inverse kinematics with full knowledge of the scene."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, Protocol

import mujoco
import numpy as np

from joshua_mujoco_sim.envs import arm_terms as arm
from joshua_mujoco_sim.envs.kinematics import REACHING, Kinematics
from joshua_mujoco_sim.envs.single import TermEnv
from joshua_mujoco_sim.envs.state import FloatArray

#: Gripper goals, rad: open, and closed on the cube (the servo presses).
OPEN_RAD, CLOSED_RAD = 0.65, -0.1

#: Gripper angle below which the jaws hold the cube.
HELD_RAD = 0.21

#: Duration of a step.
PERIOD_S = 0.04

#: Largest motion of the grip in one step, 0.25 m/s, and largest turn.
STEP_M, TURN_RAD = 0.01, 0.1

#: Height of the grip above the place where it grasps, and of the cube above the table while it is carried.
HOVER_M, CARRY_M = 0.035, 0.028

#: Place of the grip when it grasps: above the centre of the cube, so that the jaws stay clear of the table,
#: and aside, so that the open jaws are equally far from it.
GRASP_M, SIDE_M = 0.010, 0.009

#: A cube this near to the goal stays there.
AT_GOAL_M = 0.014

#: Where the arm's base turns.
BASE_Y_M = -0.045

_UP = np.array([0.0, 0.0, 1.0])

#: Recoveries: heights of the grip at the start, above the table, and its distance beside the cube, at most.
START_LOW_M, START_HIGH_M, START_BESIDE_M = 0.015, 0.16, 0.06

#: Recoveries: how often the cube lies elsewhere; distances from the arm's base, and angles from its front, at
#: which it may lie; how often beside the goal, and its distances from the goal.
PUSHED, PUSHED_M, PUSHED_RAD = 0.6, (0.11, 0.37), 1.0
BESIDE_GOAL, BESIDE_GOAL_M = 0.4, (0.024, 0.07)

#: Recoveries: speed and turn rate, at most, at which somebody moves the cube while the jaws approach; how
#: long at most, and the distance of the grip from the cube at which it is let go.
MOVED_M_S, MOVED_RAD_S = 0.2, 2.0
MOVED_S, LET_GO_M = 1.0, 0.05

#: Recoveries: how often the cube slips out of the closing jaws, at what speed, and for how many steps.
SLIPS, SLIP_M_S, SLIP_STEPS = 0.4, 0.3, (2, 4)


class Expert(Protocol):
    """Solves a task in one environment, episode by episode."""

    def scatter(self, seed: int) -> None:
        """Perhaps move the arm elsewhere before an episode; the same seed does the same.

        Call it after ``environment.reset``, before ``reset``.
        """

    def reset(self) -> None:
        """Begin an episode."""

    def act(self) -> Any:
        """Return the action of this step."""


class _ArmExpert:
    """Moves the grip along straight lines; a task is a generator of goals.

    Args:
        environment: a single environment of the task; its actions may be ``delta`` or ``absolute``.
        noise_rad: normal noise of the goals, to vary demonstrations; seed: of the noise.
        recoveries: share of the episodes that show how to recover from an error: the arm starts anywhere,
            with the jaws at any opening.
    """

    def __init__(
        self,
        environment: TermEnv,
        *,
        noise_rad: float = 0.0,
        seed: int | None = None,
        recoveries: float = 0.0,
    ) -> None:
        self._state = environment.state
        self._absolute = environment.features["action"].unit == "rad"
        self._kinematics = Kinematics(environment.state.model)
        self._noise_rad, self._chance = noise_rad, np.random.default_rng(seed)
        self._limits = arm.goal_ranges(environment.state.model)
        self._recoveries = recoveries
        model = environment.state.model
        roots = model.body_rootid
        self._arm = np.flatnonzero(roots == roots[model.body("Fixed_Jaw").id])
        self.reset()

    def scatter(self, seed: int) -> None:
        """Move the arm elsewhere in the share of episodes that show recoveries."""
        chance = np.random.default_rng([seed, 7])
        if chance.random() >= self._recoveries:
            return
        state = self._state
        self._displace(chance)
        joints = np.array(state.qpos[0, :REACHING])
        yaw, jaw = self._closing_line() + chance.uniform(-0.8, 0.8), chance.uniform(CLOSED_RAD, OPEN_RAD)
        target = self._start(chance)
        while True:
            found = self._kinematics.solve(joints, target, yaw, rounds=60)
            state.qpos[0, :6] = np.clip(np.append(found, jaw), *self._limits)
            state.qvel[0] = 0.0
            state.ctrl[0] = state.qpos[0, :6]
            state.forward(np.zeros(1, np.int64))
            if target[2] > START_HIGH_M or not self._touches():
                break
            target = target + 0.004 * _UP

    def reset(self) -> None:
        """Begin an episode."""
        self._goal = np.array(self._state.ctrl[0])
        self._at = np.array(self._state.site("gripper")[0])
        self._plan = self._steps()

    def act(self) -> Any:
        """Return the action of this step, float32."""
        goal = next(self._plan, self._goal)
        state = self._state
        wanted = goal + self._noise_rad * self._chance.standard_normal(6)
        wanted = np.clip(wanted, *self._limits)
        step = np.clip((wanted - state.ctrl[0]) / arm.STEP_RAD, -1.0, 1.0)
        self._goal = np.clip(goal, state.ctrl[0] - arm.STEP_RAD, state.ctrl[0] + arm.STEP_RAD)
        if self._absolute:
            return (state.ctrl[0] + arm.STEP_RAD * step).astype(np.float32)
        return step.astype(np.float32)

    def _steps(self) -> Iterator[FloatArray]:
        raise NotImplementedError

    def _displace(self, chance: np.random.Generator) -> None:
        """Move objects to where an error may have left them."""

    def _touches(self) -> bool:
        """Return whether the arm touches anything else."""
        contact = self._state.data.contact
        bodies = self._state.model.geom_bodyid[contact.geom[contact.dist < 0.0]]
        return bool((np.isin(bodies, self._arm).sum(axis=-1) == 1).any())

    def _start(self, chance: np.random.Generator) -> FloatArray:
        """Return a place for the grip to start at: anywhere in front of the arm."""
        radius, angle = chance.uniform(0.16, 0.28), chance.uniform(-0.9, 0.9)
        height = chance.uniform(START_LOW_M, START_HIGH_M)
        return np.array([radius * np.sin(angle), BASE_Y_M - radius * np.cos(angle), height])

    def _closing_line(self) -> float:
        """Return the angle about z of the line along which the jaws close."""
        line = self._state.data.xmat[self._state.model.body("Fixed_Jaw").id].reshape(3, 3)[:, 0]
        return float(np.arctan2(line[1], line[0]))

    def _move(self, target: FloatArray, gripper: float) -> Iterator[FloatArray]:
        """Yield goals on the way to a target."""
        while True:
            way = target - self._at
            length = float(np.linalg.norm(way))
            self._at = self._at + way * min(1.0, STEP_M / max(length, 1e-9))
            yield self._goals(self._at, gripper, None)
            if length <= STEP_M:
                break

    def _goals(self, target: FloatArray, gripper: float, yaw: float | None) -> FloatArray:
        return np.append(self._kinematics.solve(self._goal[:REACHING], target, yaw), gripper)


class ReachExpert(_ArmExpert):
    """Moves the grip to the goal and compensates for servo sag."""

    def _steps(self) -> Iterator[FloatArray]:
        gripper = float(self._goal[5])
        sag = np.zeros(3)
        while True:
            goal, at = self._state.site("goal")[0], self._state.site("gripper")[0]
            yield from self._move(goal + sag, gripper)
            sag = np.clip(sag + 0.5 * (goal - at), -0.03, 0.03)


class PickPlaceExpert(_ArmExpert):
    """Grasps the cube from above, carries it to the goal, puts it down and releases it.

    Each goal follows from where arm, cube and goal are now, not from what happened before: there is no pause
    whose end a picture does not show, and an error is corrected from wherever it leads.
    """

    _disturbed: Iterator[None] = iter(())

    def scatter(self, seed: int) -> None:
        """See ``Expert``. Where the arm starts elsewhere, the cube is moved during the episode, too."""
        self._disturbed = iter(())
        super().scatter(seed)

    def reset(self) -> None:
        """Begin an episode."""
        self._line = self._closing_line()
        super().reset()

    def act(self) -> Any:
        """Return the action of this step, float32."""
        action = super().act()
        next(self._disturbed, None)
        return action

    def _steps(self) -> Iterator[FloatArray]:
        while True:
            self._at = self._kinematics.place(self._goal[:REACHING])
            yield self._carry() if self._holds() else self._fetch()

    def _fetch(self) -> FloatArray:
        """Return the goals while the jaws are empty: away from a placed cube, or to the cube."""
        cube, goal = self._state.site("cube")[0], self._state.site("goal")[0]
        jaw = float(self._state.qpos[0, 5])
        if np.hypot(*(cube - goal)[:2]) < AT_GOAL_M:
            return self._to(self._at + (STEP_M if jaw > 0.3 else 0.0) * _UP, OPEN_RAD, self._line)
        yaw = self._grasp_angle()
        aside = SIDE_M * np.array([np.cos(yaw), np.sin(yaw), 0.0])
        way = cube + GRASP_M * _UP + aside - self._at
        error = float(np.hypot(*way[:2])) + 0.03 * abs(yaw - self._line)
        if error < 0.008 and abs(way[2]) < 0.012:
            return self._to(self._at + way, CLOSED_RAD, yaw)
        # down along a funnel: the nearer to the cube, the lower, with the jaws open
        above = HOVER_M * min(1.0, max(0.0, error - 0.004) / 0.012)
        if jaw < 0.8 * OPEN_RAD:
            above = max(above, min(HOVER_M, -float(way[2])))
        return self._to(self._at + way + above * _UP, OPEN_RAD, yaw)

    def _carry(self) -> FloatArray:
        """Return the goals while the jaws hold the cube: up, over the goal, down, and release."""
        cube, goal = self._state.site("cube")[0], self._state.site("goal")[0]
        way = (goal - cube) * (1.0, 1.0, 0.0)
        error, height = float(np.hypot(*way[:2])), float(cube[2]) - arm.HALF_CUBE_M
        if error < 0.010 and height < 0.008:
            return self._to(self._at + (0.001 - height) * _UP, OPEN_RAD, self._line)
        if error > 0.02 and height < 0.4 * CARRY_M:
            return self._to(self._at + CARRY_M * _UP, CLOSED_RAD, self._line)
        wanted = CARRY_M * min(1.0, max(0.0, error - 0.004) / 0.012)
        return self._to(self._at + way + (wanted - height) * _UP, CLOSED_RAD, self._radial(self._at))

    def _holds(self) -> bool:
        """Return whether the jaws are closed on the cube."""
        state = self._state
        near = float(np.linalg.norm(state.site("cube")[0] - state.site("gripper")[0])) < 0.028
        jaw, speed = float(state.qpos[0, 5]), float(state.qvel[0, 5])
        return near and (jaw < HELD_RAD or (jaw < 0.4 and abs(speed) < 0.3 and state.ctrl[0, 5] < jaw))

    def _to(self, target: FloatArray, gripper: float, yaw: float) -> FloatArray:
        """Return the goals of one step towards a target."""
        way = target - self._at
        length = float(np.linalg.norm(way))
        self._at = self._at + way * min(1.0, STEP_M / max(length, 1e-9))
        self._line += float(np.clip(yaw - self._line, -TURN_RAD, TURN_RAD))
        return self._goals(self._at, gripper, self._line)

    def _start(self, chance: np.random.Generator) -> FloatArray:
        """Return a place for the grip to start at: in half of the episodes above the cube or beside it."""
        anywhere = super()._start(chance)
        if chance.random() < 0.5:
            return anywhere
        # low ones beside the cube, where a policy ends that has misjudged its place
        cube = self._state.site("cube")[0]
        away, angle = chance.uniform(0.0, START_BESIDE_M), chance.uniform(-np.pi, np.pi)
        height = START_LOW_M - arm.HALF_CUBE_M + chance.triangular(0.0, 0.0, 0.7 * START_HIGH_M)
        beside: FloatArray = cube + np.array([away * np.cos(angle), away * np.sin(angle), height])
        return beside

    def _displace(self, chance: np.random.Generator) -> None:
        """Move the cube, in most episodes: to where jaws that miss it push it, or where they lose it."""
        self._disturbed = self._disturb(np.random.default_rng(chance.integers(2**32)))
        if chance.random() >= PUSHED:
            return
        state, goal = self._state, self._state.site("goal")[0, :2]
        beside = chance.random() < BESIDE_GOAL
        while True:
            if beside:
                radius, angle = chance.uniform(*BESIDE_GOAL_M), chance.uniform(-np.pi, np.pi)
                place = goal + radius * np.array([np.cos(angle), np.sin(angle)])
            else:
                radius, angle = chance.uniform(*PUSHED_M), chance.uniform(-PUSHED_RAD, PUSHED_RAD)
                place = np.array([radius * np.sin(angle), BASE_Y_M - radius * np.cos(angle)])
            if self._is_free(place, BESIDE_GOAL_M[0]):
                break
        half_turn = chance.uniform(-np.pi, np.pi) / 2
        state.qpos[0, 6:13] = *place, arm.HALF_CUBE_M, np.cos(half_turn), 0.0, 0.0, np.sin(half_turn)
        state.forward(np.zeros(1, np.int64))

    def _disturb(self, chance: np.random.Generator) -> Iterator[None]:
        """Move the cube step by step: while the jaws approach it, and out of them when they close.

        One episode shows a line of places instead of one, and the view of a cube that the jaws have missed.
        All directions are equally likely, so a policy cannot guess the next place.
        """
        state = self._state
        turn_rad_s = chance.uniform(-MOVED_RAD_S, MOVED_RAD_S)
        angle, speed = chance.uniform(-np.pi, np.pi), chance.uniform(0.3 * MOVED_M_S, MOVED_M_S)
        for _ in range(int(chance.uniform(0.0, MOVED_S) / PERIOD_S)):
            if np.linalg.norm(state.site("cube")[0] - state.site("gripper")[0]) < LET_GO_M:
                break
            for _ in range(20):
                if self._move_cube(angle, speed, turn_rad_s):
                    break
                angle = chance.uniform(-np.pi, np.pi)
            yield
        if chance.random() >= SLIPS:
            return
        while not (state.ctrl[0, 5] < 0.5 * OPEN_RAD and HELD_RAD < state.qpos[0, 5] < 0.8 * OPEN_RAD):
            yield
        across = self._line + chance.choice((-0.5, 0.5)) * np.pi
        for _ in range(chance.integers(*SLIP_STEPS, endpoint=True)):
            self._move_cube(across, SLIP_M_S, turn_rad_s)
            yield

    def _move_cube(self, angle: float, speed_m_s: float, turn_rad_s: float) -> bool:
        """Move the cube by one step; return False if it would leave its area or come to the goal."""
        state = self._state
        cube = state.site("cube")[0, :2]
        place = cube + speed_m_s * PERIOD_S * np.array([np.cos(angle), np.sin(angle)])
        if not self._is_free(place, 2 * arm.PLACED_M):
            return False
        half_turn, turned = 0.5 * PERIOD_S * turn_rad_s, np.zeros(4)
        turn = np.array([np.cos(half_turn), 0.0, 0.0, np.sin(half_turn)])
        mujoco.mju_mulQuat(turned, turn, state.qpos[0, 9:13])
        state.qpos[0, 6:8], state.qpos[0, 9:13] = place, turned
        return True

    def _is_free(self, place: FloatArray, least_m: float) -> bool:
        """Return whether the arm reaches a place well, at least at some distance from the goal."""
        radius = np.hypot(place[0], place[1] - BASE_Y_M)
        inside = PUSHED_M[0] <= radius <= PUSHED_M[1] and abs(self._radial(place)) <= PUSHED_RAD
        goal = self._state.site("goal")[0, :2]
        return bool(inside and np.hypot(*(place - goal)) >= least_m)

    @staticmethod
    def _radial(place: FloatArray) -> float:
        """Return the angle about z at which the jaws close across the line from the base to a place."""
        return float(np.arctan2(place[0], -(place[1] - BASE_Y_M)))

    def _grasp_angle(self) -> float:
        """Return the closing direction of the jaws about z: across two faces of the cube.

        Of the four directions, the one with the smallest wrist rotation.
        """
        w, x, y, z = self._state.qpos[0, 9:13]
        yaw = float(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
        across = self._radial(self._state.site("cube")[0])
        return across + (yaw - across + np.pi / 4) % (np.pi / 2) - np.pi / 4


#: The expert of each environment that has one.
EXPERTS: dict[str, Callable[..., Expert]] = {
    "joshua/SoArm100Reach-v0": ReachExpert,
    "joshua/SoArm100PickPlace-v0": PickPlaceExpert,
}

"""Scripted demonstrators: solve a task by inverse kinematics with full knowledge of the scene."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, Protocol

import numpy as np

from joshua_mujoco_sim.envs import arm_terms as arm
from joshua_mujoco_sim.envs.kinematics import BASE_Y_M, REACHING, Kinematics, radial
from joshua_mujoco_sim.envs.recoveries import (
    BESIDE_GOAL,
    BESIDE_GOAL_M,
    MISSED_DOWN_STEPS,
    MISSED_M,
    MISSED_STEPS,
    MISSES,
    PUSHED,
    SLIPS,
    START_BESIDE_M,
    START_HIGH_M,
    START_LOW_M,
    LooseCube,
)
from joshua_mujoco_sim.envs.single import TermEnv
from joshua_mujoco_sim.envs.state import FloatArray

#: Gripper goals, rad: open, and closed on the cube (the servo presses).
OPEN_RAD, CLOSED_RAD = 0.65, -0.1

#: Gripper angle below which the jaws hold the cube.
HELD_RAD = 0.21

#: Distance of the grip from a cube on which the jaws close, at most.
CLOSING_M = 0.04

#: Largest motion of the grip in one step, 0.25 m/s, and largest turn.
STEP_M, TURN_RAD = 0.01, 0.1

#: Height of the grip above the place where it grasps, and of the cube above the table while it is carried.
HOVER_M, CARRY_M = 0.035, 0.028

#: Distances beside the cube: nearer than the first, the grip goes all the way down and closes; farther away
#: than the second, it hovers. Then those of the cube from the goal: nearer, it is put down and released;
#: farther away, it is lifted. Pictures show a place to 7 mm or so: a policy whose expert went down at 4 mm
#: hovered where it could not tell.
DOWN_M, HOVERS_M = 0.014, 0.026
RELEASE_M, LIFTED_M = 0.012, 0.024

#: Place of the grip when it grasps: above the centre of the cube, so that the jaws stay clear of the table,
#: and aside, so that the open jaws are equally far from it.
GRASP_M, SIDE_M = 0.010, 0.009

#: Share of the cube's distance to the goal that one step corrects. The cube lags behind the goals of the
#: servos: with all of it, the arm carries the cube back and forth across the goal.
CARRY_GAIN = 0.5

#: A cube this near to the goal stays there.
AT_GOAL_M = 0.014

#: Steps that a demonstration goes on after its success. A policy that has seen only the first steps of an arm
#: that leaves a placed cube stops there, before it has let go.
AFTER_STEPS = 10

_UP = np.array([0.0, 0.0, 1.0])

_ONLY = np.zeros(1, np.int64)


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
        if chance.random() < self._recoveries:
            self._err(chance)

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

    def _err(self, chance: np.random.Generator) -> None:
        """Bring about a state that follows an error: the arm is anywhere, with the jaws at any opening."""
        radius, angle = chance.uniform(0.16, 0.28), chance.uniform(-0.9, 0.9)
        height = chance.uniform(START_LOW_M, START_HIGH_M)
        place = np.array([radius * np.sin(angle), BASE_Y_M - radius * np.cos(angle), height])
        self._put(
            place, self._closing_line() + chance.uniform(-0.8, 0.8), chance.uniform(CLOSED_RAD, OPEN_RAD)
        )

    def _put(self, target: FloatArray, yaw: float, jaw: float) -> None:
        """Put the grip to a place, or above it where it touches nothing."""
        state = self._state
        joints = np.array(state.qpos[0, :REACHING])
        while True:
            found = self._kinematics.solve(joints, target, yaw, rounds=60)
            state.qpos[0, :6] = np.clip(np.append(found, jaw), *self._limits)
            state.qvel[0] = 0.0
            state.ctrl[0] = state.qpos[0, :6]
            state.forward(_ONLY)
            if target[2] > START_HIGH_M or not self._touches():
                break
            target = target + 0.004 * _UP

    def _touches(self) -> bool:
        """Return whether the arm touches anything else."""
        contact = self._state.data.contact
        bodies = self._state.model.geom_bodyid[contact.geom[contact.dist < 0.0]]
        return bool((np.isin(bodies, self._arm).sum(axis=-1) == 1).any())

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

    def __init__(self, environment: TermEnv, **options: Any) -> None:
        self._frame_skip = environment.task.frame_skip
        period_s = self._frame_skip * environment.state.model.opt.timestep
        self._cube = LooseCube(environment.state, period_s)
        self._disturbed: Iterator[None] = iter(())
        super().__init__(environment, **options)

    def scatter(self, seed: int) -> None:
        """See ``Expert``. Where the episode begins with an error, others follow."""
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
        if error < DOWN_M and abs(way[2]) < 0.012:
            return self._to(self._at + way, CLOSED_RAD, yaw)
        # down along a funnel: the nearer to the cube, the lower, with the jaws open
        above = HOVER_M * min(1.0, max(0.0, error - DOWN_M) / (HOVERS_M - DOWN_M))
        if jaw < 0.8 * OPEN_RAD:
            above = max(above, min(HOVER_M, -float(way[2])))
        return self._to(self._at + way + above * _UP, OPEN_RAD, yaw)

    def _carry(self) -> FloatArray:
        """Return the goals while the jaws hold the cube: up, over the goal, down, and release."""
        cube, goal = self._state.site("cube")[0], self._state.site("goal")[0]
        way = (goal - cube) * (1.0, 1.0, 0.0)
        error, height = float(np.hypot(*way[:2])), float(cube[2]) - arm.HALF_CUBE_M
        if error < RELEASE_M and height < 0.008:
            return self._to(self._at + (0.001 - height) * _UP, OPEN_RAD, self._line)
        if error > LIFTED_M and height < 0.4 * CARRY_M:
            return self._to(self._at + CARRY_M * _UP, CLOSED_RAD, self._line)
        wanted = CARRY_M * min(1.0, max(0.0, error - RELEASE_M) / (LIFTED_M - RELEASE_M))
        to_goal = CARRY_GAIN * way + (wanted - height) * _UP
        return self._to(self._at + to_goal, CLOSED_RAD, radial(self._at))

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

    def _err(self, chance: np.random.Generator) -> None:
        """Bring about a state that follows an error: cube, arm or both are elsewhere."""
        self._disturbed = self._disturb(np.random.default_rng(chance.integers(2**32)))
        if chance.random() < PUSHED:
            self._cube.lay(chance, beside_goal=chance.random() < BESIDE_GOAL)
            self._state.forward(_ONLY)
        if chance.random() < 0.5:
            super()._err(chance)
        elif chance.random() < MISSES:
            self._miss(chance)
        else:
            # low and beside the cube, where a policy ends that has misjudged its place
            away, angle = chance.uniform(0.0, START_BESIDE_M), chance.uniform(-np.pi, np.pi)
            height = START_LOW_M - arm.HALF_CUBE_M + chance.triangular(0.0, 0.0, 0.7 * START_HIGH_M)
            place = self._cube.place + np.array([away * np.cos(angle), away * np.sin(angle), height])
            yaw = self._closing_line() + chance.uniform(-0.8, 0.8)
            self._put(place, yaw, chance.uniform(CLOSED_RAD, OPEN_RAD))

    def _miss(self, chance: np.random.Generator) -> None:
        """Grasp beside the cube, which the jaws may push or tilt."""
        state = self._state
        missed, angle = chance.uniform(*MISSED_M), chance.uniform(-np.pi, np.pi)
        place = self._cube.place + GRASP_M * _UP + missed * np.array([np.cos(angle), np.sin(angle), 0.0])
        yaw = self._grasp_angle()
        self._put(place, yaw, OPEN_RAD)
        before, time_s = (np.array(state.qpos), np.array(state.ctrl)), state.data.time
        joints = self._kinematics.solve(state.ctrl[0, :REACHING], place, yaw, rounds=60)
        closing = chance.integers(*MISSED_STEPS, endpoint=True)
        for step in range(MISSED_DOWN_STEPS + closing):
            wanted = np.append(joints, OPEN_RAD if step < MISSED_DOWN_STEPS else CLOSED_RAD)
            change = np.clip(wanted - state.ctrl[0], -arm.STEP_RAD, arm.STEP_RAD)
            state.ctrl[0] = np.clip(state.ctrl[0] + change, *self._limits)
            state.step(self._frame_skip)
        if not self._cube.is_free(self._cube.place[:2], BESIDE_GOAL_M[0]):
            state.qpos[:], state.ctrl[:] = before
            state.qvel[:] = 0.0
        state.data.time = time_s
        state.forward(_ONLY)

    def _disturb(self, chance: np.random.Generator) -> Iterator[None]:
        """Move the cube step by step: while the jaws approach it, and out of them when they close.

        One episode shows a line of places instead of one, and the view of a cube that the jaws have missed.
        """
        state = self._state
        yield from self._cube.slide(chance)
        if chance.random() >= SLIPS:
            return
        while not (
            np.linalg.norm(self._cube.place - state.site("gripper")[0]) < CLOSING_M
            and state.ctrl[0, 5] < 0.5 * OPEN_RAD
            and HELD_RAD < state.qpos[0, 5] < 0.8 * OPEN_RAD
        ):
            yield
        yield from self._cube.slip(chance, self._line)

    def _grasp_angle(self) -> float:
        """Return the closing direction of the jaws about z: across two faces of the cube.

        Of the four directions, the one with the smallest wrist rotation.
        """
        w, x, y, z = self._state.qpos[0, 9:13]
        yaw = float(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
        across = radial(self._state.site("cube")[0])
        return across + (yaw - across + np.pi / 4) % (np.pi / 2) - np.pi / 4


#: The expert of each environment that has one.
EXPERTS: dict[str, Callable[..., Expert]] = {
    "joshua/SoArm100Reach-v0": ReachExpert,
    "joshua/SoArm100PickPlace-v0": PickPlaceExpert,
}

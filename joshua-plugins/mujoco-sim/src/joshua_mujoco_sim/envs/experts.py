"""Scripted demonstrators: solve a task by inverse kinematics with full knowledge of the scene."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, Protocol

import mujoco
import numpy as np

from joshua_mujoco_sim.envs import arm_terms as arm
from joshua_mujoco_sim.envs.single import TermEnv
from joshua_mujoco_sim.envs.state import FloatArray

#: Joints that place the grip; the sixth is the gripper.
_REACHING = 5

#: Gripper goals, rad: open for the cube, closed on it (the servo presses), released.
OPEN_RAD, CLOSED_RAD, RELEASED_RAD = 0.9, -0.1, 0.7

#: Largest motion of the grip in one step: 0.25 m/s.
STEP_M = 0.008

#: Height of the grip above the cube before and after it is held.
HOVER_M, CARRY_M = 0.042, 0.028

#: Height of the grip above the centre of the cube when grasping; keeps the moving jaw clear of the table.
GRASP_M = 0.006

#: Recoveries: spread of the first approach beside its target, and of its angle.
ASTRAY_M, ASTRAY_RAD = 0.02, 0.3

#: Recoveries: heights of the grip at the start, above the table.
START_LOW_M, START_HIGH_M = 0.05, 0.16


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


class Kinematics:
    """Inverse kinematics of the SO-ARM100 on its own data.

    Args:
        model: contains the arm; the arm's joints come first.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model, self._data = model, mujoco.MjData(model)
        self._site, self._jaw = model.site("gripper").id, model.body("Fixed_Jaw").id
        self._low, self._high = model.jnt_range[:_REACHING].T
        self._jacobians = np.zeros((3, model.nv)), np.zeros((3, model.nv))

    def solve(
        self, joints: FloatArray, target_m: FloatArray, yaw_rad: float | None = None, rounds: int = 12
    ) -> FloatArray:
        """Return joint angles (rad) near ``joints`` that bring the grip to a point.

        Args:
            joints: where the search starts, rad, five.
            target_m: of the grip. With ``yaw_rad`` it points down as far as possible, and the jaws close
                along a horizontal line at that angle about z, in either orientation.
        """
        model, data, (translation, rotation) = self._model, self._data, self._jacobians
        found = np.array(joints)
        for _ in range(rounds):
            data.qpos[:_REACHING] = found
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_jacSite(model, data, translation, rotation, self._site)
            rows = [translation[:, :_REACHING]]
            errors = [target_m - data.site_xpos[self._site]]
            if yaw_rad is not None:
                frame = data.xmat[self._jaw].reshape(3, 3)
                turn = 0.03 * self._turn(frame, yaw_rad)
                rows.append(0.03 * rotation[:, :_REACHING])
                errors.append(turn)
            matrix, error = np.concatenate(rows), np.concatenate(errors)
            normal = matrix.T @ matrix + 3e-4 * np.eye(_REACHING)
            change = np.linalg.solve(normal, matrix.T @ error)
            found = np.clip(found + np.clip(change, -0.3, 0.3), self._low, self._high)
        return found

    @staticmethod
    def _turn(frame: FloatArray, yaw_rad: float) -> FloatArray:
        """Return the remaining rotation vector (world): fingers (-y) down, x along the line."""
        down = np.cross(-frame[:, 1], (0.0, 0.0, -1.0))
        line = np.array([np.cos(yaw_rad), np.sin(yaw_rad), 0.0])
        line = line if line @ frame[:, 0] >= 0 else -line
        about_z = np.cross(frame[:, 0], line)[2]
        turn: FloatArray = down + np.array([0.0, 0.0, about_z])
        return turn


class _ArmExpert:
    """Moves the grip along straight lines; a task is a generator of targets.

    Args:
        environment: a single environment of the task; its actions may be ``delta`` or ``absolute``.
        noise_rad: normal noise of the goals, to vary demonstrations; seed: of the noise.
        recoveries: share of the episodes that show how to recover: the arm starts anywhere, with the jaws at
            any opening, and approaches its targets beside before it corrects itself.
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
        self._recoveries, self._recovers = recoveries, False
        self.reset()

    def scatter(self, seed: int) -> None:
        """Move the arm elsewhere in the share of episodes that show recoveries."""
        chance = np.random.default_rng([seed, 7])
        self._recovers = chance.random() < self._recoveries
        if not self._recovers:
            return
        state = self._state
        joints = np.array(state.qpos[0, :_REACHING])
        yaw = self._closing_line() + chance.uniform(-0.8, 0.8)
        found = self._kinematics.solve(joints, self._start(chance), yaw, rounds=60)
        pose = np.append(found, chance.uniform(CLOSED_RAD, OPEN_RAD))
        state.qpos[0, :6] = np.clip(pose, *self._limits)
        state.qvel[0] = 0.0
        state.ctrl[0] = state.qpos[0, :6]
        state.forward(np.zeros(1, np.int64))

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
        self._goal = goal
        if self._absolute:
            return (state.ctrl[0] + arm.STEP_RAD * step).astype(np.float32)
        return step.astype(np.float32)

    def _steps(self) -> Iterator[FloatArray]:
        raise NotImplementedError

    def _start(self, chance: np.random.Generator) -> FloatArray:
        """Return a place for the grip to start at: anywhere in front of the arm."""
        radius, angle = chance.uniform(0.16, 0.28), chance.uniform(-0.9, 0.9)
        height = chance.uniform(START_LOW_M, START_HIGH_M)
        return np.array([radius * np.sin(angle), -0.045 - radius * np.cos(angle), height])

    def _astray(self) -> tuple[FloatArray, float]:
        """Return the error of a first approach (m) and of its angle."""
        draw = self._chance.standard_normal(3)
        return ASTRAY_M * draw * (1.0, 1.0, 0.0), ASTRAY_RAD * float(draw[2])

    def _closing_line(self) -> float:
        """Return the angle about z of the line along which the jaws close."""
        line = self._state.data.xmat[self._state.model.body("Fixed_Jaw").id].reshape(3, 3)[:, 0]
        return float(np.arctan2(line[1], line[0]))

    def _move(
        self,
        target: FloatArray | Callable[[], FloatArray],
        gripper: float,
        yaw: float | None = None,
        settle: int = 0,
    ) -> Iterator[FloatArray]:
        """Yield goals on the way to a target, which may move, and further ones while the arm settles."""
        present = target if callable(target) else lambda: target
        while True:
            way = present() - self._at
            length = float(np.linalg.norm(way))
            self._at = self._at + way * min(1.0, STEP_M / max(length, 1e-9))
            yield self._goals(self._at, gripper, yaw)
            if length <= STEP_M:
                break
        for _ in range(settle):
            yield self._goals(present(), gripper, yaw)

    def _goals(self, target: FloatArray, gripper: float, yaw: float | None) -> FloatArray:
        return np.append(self._kinematics.solve(self._goal[:_REACHING], target, yaw), gripper)


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
    """Grasps the cube from above, carries it over the goal, places it and releases it."""

    def _steps(self) -> Iterator[FloatArray]:
        def cube() -> FloatArray:
            return np.array(self._state.site("cube")[0])

        def goal() -> FloatArray:
            return np.array(self._state.site("goal")[0])

        up = np.array([0.0, 0.0, 1.0])

        def held() -> bool:
            return float(np.linalg.norm(cube() - self._state.site("gripper")[0])) < arm.LET_GO_M

        while True:
            yaw = self._grasp_angle()
            if self._recovers:
                beside, turned = self._astray()
                yield from self._move(cube() + HOVER_M * up + beside, OPEN_RAD, yaw + turned)
            yield from self._move(lambda: cube() + HOVER_M * up, OPEN_RAD, yaw, settle=2)
            yield from self._move(lambda: cube() + GRASP_M * up, OPEN_RAD, yaw, settle=2)
            place = cube() + GRASP_M * up
            for _ in range(13):
                yield self._goals(place, CLOSED_RAD, yaw)
            lifted = place + CARRY_M * up
            yield from self._move(lifted, CLOSED_RAD, yaw, settle=1)
            if not held():
                continue
            # the cube is where the jaws hold it, not where the grip is
            over = goal() + (self._at - cube()) * (1.0, 1.0, 0.0) + (CARRY_M + GRASP_M) * up
            if self._recovers:
                yield from self._move(over + self._astray()[0], CLOSED_RAD, yaw)
            yield from self._move(over, CLOSED_RAD, yaw, settle=2)
            over = over + (goal() - cube()) * (1.0, 1.0, 0.0)
            if not held():
                continue
            down = over - (CARRY_M - 0.001) * up
            yield from self._move(down, CLOSED_RAD, yaw, settle=2)
            if not held():
                continue
            for _ in range(6):
                yield self._goals(down, RELEASED_RAD, yaw)
            yield from self._move(over, RELEASED_RAD, yaw, settle=5)

    def _start(self, chance: np.random.Generator) -> FloatArray:
        """Return a place for the grip to start at: most often above the cube or beside it."""
        anywhere = super()._start(chance)
        if chance.random() > 0.7:
            return anywhere
        beside: FloatArray = self._state.site("cube")[0] + chance.uniform(-0.05, 0.05, 3)
        beside[2] = anywhere[2]
        return beside

    def _grasp_angle(self) -> float:
        """Return the closing direction of the jaws about z: across two faces of the cube.

        Of the four directions, the one with the smallest wrist rotation.
        """
        w, x, y, z = self._state.qpos[0, 9:13]
        yaw = float(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
        present = self._closing_line()
        return present + (yaw - present + np.pi / 4) % (np.pi / 2) - np.pi / 4


#: The expert of each environment that has one.
EXPERTS: dict[str, Callable[..., Expert]] = {
    "joshua/SoArm100Reach-v0": ReachExpert,
    "joshua/SoArm100PickPlace-v0": PickPlaceExpert,
}

"""One model with its state: stepping, joint groups, and detection of divergence."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from difflib import get_close_matches

import mujoco
import numpy as np
import numpy.typing as npt

from joshua_mujoco_sim.actuator_group import ActuatorGroup
from joshua_mujoco_sim.drivable import DrivableJoint, drivables, must_be_driven_each_step
from joshua_mujoco_sim.model_file import ModelError
from joshua_mujoco_sim.position_loop import PositionLoop
from joshua_mujoco_sim.transmission import single_joints
from joshua_mujoco_sim.variation import Variation, Varier

FloatArray = npt.NDArray[np.float64]

#: Speed above which a joint counts as diverged; no supported robot moves nearly as fast.
VELOCITY_LIMIT_RAD_S = 1e4


def _note(text: str) -> None:
    """Log MuJoCo's warnings, which it would otherwise write to a file in the current folder."""
    logging.getLogger("joshua.mujoco").debug("%s", text)


class DivergenceError(Exception):
    """The simulation has diverged.

    Attributes:
        time_s: simulated time; joint: name of the first diverged joint.
    """

    def __init__(self, time_s: float, joint: str, what: str) -> None:
        super().__init__(
            f"the simulation diverged at {time_s:.3f} s: {joint} has {what}: "
            "use a smaller timestep in the model, or softer gains and contacts"
        )
        self.time_s = time_s
        self.joint = joint


class Physics:
    """A compiled model and its data. Not thread-safe.

    Args:
        model: the compiled model.
        keyframe: state at start and reset; "" means ``home`` if the model has it, else its default.
        variation: varies the scene at each start; None leaves it unchanged.

    Raises:
        ModelError: the model has no keyframe of that name.
    """

    def __init__(
        self, model: mujoco.MjModel, *, keyframe: str = "", variation: Variation | None = None
    ) -> None:
        self.model = model
        # MuJoCo would silently reset a diverged state; the check below reports it instead.
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        mujoco.set_mju_user_warning(_note)
        self.data = mujoco.MjData(model)
        #: Stall force of each drive: its first ``user`` value, else its limit in the model.
        self.stall_forces: FloatArray = np.abs(model.actuator_forcerange).max(axis=1)
        if model.nuser_actuator:
            named = model.actuator_user[:, 0]
            self.stall_forces = np.where(named > 0, named, self.stall_forces)
        names = [model.key(index).name for index in range(model.nkey)]
        if keyframe and keyframe not in names:
            raise ModelError(f"the model has no keyframe {keyframe!r}: it has {', '.join(names) or 'none'}")
        wanted = keyframe or "home"
        self._key = names.index(wanted) if wanted in names else -1
        # attached models have their own keyframes, under their prefix
        self._further_keys = [
            (index, name.removesuffix(wanted))
            for index, name in enumerate(names)
            if name.endswith(f"/{wanted}")
        ]
        self._speed: FloatArray = np.zeros(model.nv)
        mujoco.mj_forward(model, self.data)
        found = drivables(model)
        self._joints = found.joints
        self._joint_by_name = found.by_name()
        self._refusals = found.refused()
        looped = [joint for joint in found.joints if must_be_driven_each_step(model, joint)]
        #: Drives the joints whose actuators do not take positions; ``loop_places`` has their places in it.
        others = [joint for joint in found.joints if joint not in looped]
        self.loop = PositionLoop(model, self.data, looped, others)
        self.loop_places = {joint.name: place for place, joint in enumerate(looped)}
        self._varier = Varier(model, variation) if variation else None
        self._starts = 0
        self._begin: tuple[ActuatorGroup, FloatArray] | None = None
        self.reset()

    @property
    def time_s(self) -> float:
        """Simulated time."""
        return float(self.data.time)

    @property
    def timestep_s(self) -> float:
        """Simulated time of one step."""
        return float(self.model.opt.timestep)

    def reset(self, start: int | None = None) -> None:
        """Reset the model to its start at time zero.

        Args:
            start: index of the start in a varied scene; None means the next one.
        """
        if self._key >= 0:
            mujoco.mj_resetDataKeyframe(self.model, self.data, self._key)
        else:
            mujoco.mj_resetData(self.model, self.data)
            self._enter_limits()
        self.loop.clear()
        for key, prefix in self._further_keys:
            self._take_from_keyframe(key, prefix)
        if self._begin is not None:
            group, position = self._begin
            group.set_position(position)
            group.set_command(position)
        if self._varier is not None:
            self._varier.apply(self.data, self._starts if start is None else start)
            self._starts = 1 + (self._starts if start is None else start)
        mujoco.mj_forward(self.model, self.data)

    def begin_at(self, group: ActuatorGroup, position: FloatArray) -> None:
        """Use these joint positions, shape (N,), at every further start instead of the keyframe's."""
        self._begin = (group, np.array(position))

    def step(self, count: int = 1) -> None:
        """Run steps. Raises DivergenceError."""
        if self.loop.active:
            for _ in range(count):
                self.step_unchecked()
        else:
            mujoco.mj_step(self.model, self.data, count)
        self.check()

    def step_unchecked(self) -> None:
        """Run one step; a divergence is left to ``check``."""
        if self.loop.active:
            self.loop.apply()
        mujoco.mj_step(self.model, self.data)

    def check(self) -> None:
        """Raise DivergenceError if a speed is not finite or excessive, as after any bad state."""
        speed = self._speed
        np.abs(self.data.qvel, out=speed)
        if not speed.max(initial=0.0) < VELOCITY_LIMIT_RAD_S:  # also true for NaN
            raise self._divergence()

    def group(self, names: Sequence[str]) -> ActuatorGroup:
        """Return joints by their names or those of their actuators or tendons, () for all that can be driven.

        Raises:
            ModelError: a name is unknown, or means an actuator that cannot be driven, or a joint comes twice.
        """
        return ActuatorGroup(self, names)

    def drivable_joints(self, names: Sequence[str] = ()) -> tuple[DrivableJoint, ...]:
        """Return the joints of some names, () for all that can be driven. Raises ModelError as ``group``."""
        if not names:
            return self._joints
        chosen: list[DrivableJoint] = []
        for name in names:
            joint = self._joint_by_name.get(name)
            if joint is None:
                raise ModelError(self._why_not(name))
            if joint in chosen:
                other = names[chosen.index(joint)]
                raise ModelError(f"{name!r} and {other!r} are the same joint {joint.name}: name it once")
            chosen.append(joint)
        return tuple(chosen)

    def _why_not(self, name: str) -> str:
        """Return why a name means no joint that can be driven."""
        if name in self._refusals:
            return f"the model's actuator {self._refusals[name]}, so it cannot be commanded to a position"
        known = [joint.name for joint in self._joints]
        near = get_close_matches(name, self._joint_by_name, n=1, cutoff=0.0)
        nearest = f"did you mean {near[0]}? " if near else ""
        return f"the model has no actuator {name!r}: {nearest}it has {', '.join(known) or 'none'}"

    def _enter_limits(self) -> None:
        """Move joints that start outside their limits to the nearest end, as the limits would do by force."""
        model, data = self.model, self.data
        for joint in single_joints(model):
            if model.jnt_limited[joint]:
                place = model.jnt_qposadr[joint]
                low, high = model.jnt_range[joint]
                data.qpos[place] = min(max(data.qpos[place], low), high)

    def _take_from_keyframe(self, key: int, prefix: str) -> None:
        """Set the joints and actuators under a prefix to a keyframe."""
        model, data = self.model, self.data
        for index in range(model.njnt):
            if model.joint(index).name.startswith(prefix):
                start = int(model.jnt_qposadr[index])
                end = int(model.jnt_qposadr[index + 1]) if index + 1 < model.njnt else model.nq
                data.qpos[start:end] = model.key_qpos[key, start:end]
        for index in range(model.nu):
            if model.actuator(index).name.startswith(prefix):
                data.ctrl[index] = model.key_ctrl[key, index]

    def _divergence(self) -> DivergenceError:
        speeds = np.nan_to_num(self._speed, nan=np.inf)
        dof = int(speeds.argmax())
        joint = self._name(int(self.model.dof_jntid[dof]))
        what = f"a speed of {speeds[dof]:.3g} rad/s" if np.isfinite(speeds[dof]) else "no finite speed"
        return DivergenceError(self.time_s, joint, what)

    def _name(self, joint: int) -> str:
        return self.model.joint(joint).name or f"joint number {joint}"

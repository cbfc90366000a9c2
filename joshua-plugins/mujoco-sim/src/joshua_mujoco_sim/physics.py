"""One model with its state: stepping, joint groups, and detection of divergence."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from difflib import get_close_matches

import mujoco
import numpy as np
import numpy.typing as npt

from joshua_mujoco_sim.model_file import ModelError
from joshua_mujoco_sim.variation import Variation, Varier

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

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
        mujoco.mj_step(self.model, self.data, count)
        self.check()

    def check(self) -> None:
        """Raise DivergenceError if a speed is not finite or excessive, as after any bad state."""
        speed = self._speed
        np.abs(self.data.qvel, out=speed)
        if not speed.max(initial=0.0) < VELOCITY_LIMIT_RAD_S:  # also true for NaN
            raise self._divergence()

    def group(self, actuators: Sequence[str]) -> ActuatorGroup:
        """Return a group of actuators by name. Raises ModelError for an unknown name."""
        return ActuatorGroup(self, actuators)

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


class ActuatorGroup:
    """A group of actuators of a model and the joints that they drive, in a given order.

    Attributes:
        names: actuators; joints: names of their joints.
        range_min_rad, range_max_rad: limits of the joints, shape (N,); infinite where a joint has none.
        goes_to_positions, goes_at_speeds: kind of command of each drive, shape (N,); neither for others.
    """

    def __init__(self, physics: Physics, actuators: Sequence[str]) -> None:
        model = physics.model
        known = [model.actuator(index).name for index in range(model.nu)]
        self.names = tuple(actuators) or tuple(known)
        for name in actuators:
            if not name or name not in known:
                near = get_close_matches(name, known, n=1, cutoff=0.0)
                nearest = f"did you mean {near[0]}? " if near else ""
                raise ModelError(
                    f"the model has no actuator {name!r}: {nearest}it has {', '.join(known) or 'none'}"
                )
        # Not by name if all are meant, because several may have none.
        wanted = [known.index(name) for name in actuators] if actuators else range(len(known))
        ids = np.array(wanted, dtype=np.int64)
        joints = model.actuator_trnid[ids, 0].astype(np.int64)
        unfit = [
            name
            for name, index in zip(self.names, ids, strict=True)
            if model.actuator_trntype[index] != mujoco.mjtTrn.mjTRN_JOINT
        ]
        if unfit:
            raise ModelError(f"{', '.join(unfit)}: only actuators that drive one joint can be commanded")
        self.joints = tuple(model.joint(int(joint)).name for joint in joints)
        self._data = physics.data
        self._ctrl: IntArray = ids
        self._model = model
        bias = model.actuator_biasprm[ids, 1]
        affine = model.actuator_biastype[ids] == mujoco.mjtBias.mjBIAS_AFFINE
        self.goes_to_positions: BoolArray = affine & (bias < 0)
        self.goes_at_speeds: BoolArray = affine & (bias == 0)
        self._qpos: IntArray = model.jnt_qposadr[joints].astype(np.int64)
        self._dof: IntArray = model.jnt_dofadr[joints].astype(np.int64)
        #: Command of each actuator: a position (radians), a velocity (rad/s) or a torque (N·m).
        self.drives = tuple(_drive(model, int(index)) for index in ids)
        limited = model.jnt_limited[joints].astype(bool)
        ranges = model.jnt_range[joints]
        self.range_min_rad: FloatArray = np.where(limited, ranges[:, 0], -np.inf)
        self.range_max_rad: FloatArray = np.where(limited, ranges[:, 1], np.inf)
        self.force_limit: FloatArray = np.where(
            model.actuator_forcelimited[ids].astype(bool),
            np.abs(model.actuator_forcerange[ids]).max(axis=1),
            np.inf,
        )

    def __len__(self) -> int:
        return len(self.names)

    @property
    def ranges_rad(self) -> dict[str, tuple[float, float]]:
        """Return lower and upper limit of each joint by name; infinite if it has none."""
        ends = zip(self.range_min_rad.tolist(), self.range_max_rad.tolist(), strict=True)
        return dict(zip(self.joints, ends, strict=True))

    @property
    def middle_rad(self) -> FloatArray:
        """Middles of the joints' ranges, shape (N,); 0 for a joint without limits."""
        middle = (self.range_min_rad + self.range_max_rad) / 2
        return np.where(np.isfinite(middle), middle, 0.0)

    @property
    def position_rad(self) -> FloatArray:
        """Positions of the joints, shape (N,), a copy."""
        return np.asarray(self._data.qpos[self._qpos])

    @property
    def degrees_of_freedom(self) -> IntArray:
        """Indices of the joints among the model's degrees of freedom, shape (N,)."""
        return self._dof

    @property
    def velocity_rad_s(self) -> FloatArray:
        """Speeds of the joints, shape (N,), a copy."""
        return np.asarray(self._data.qvel[self._dof])

    @property
    def torque(self) -> FloatArray:
        """Forces that the actuators apply, N·m, shape (N,), a copy."""
        return np.asarray(self._data.actuator_force[self._ctrl])

    @property
    def command(self) -> FloatArray:
        """Commands of the actuators, shape (N,), a copy."""
        return np.asarray(self._data.ctrl[self._ctrl])

    @property
    def free_command(self) -> FloatArray:
        """Commands for which the drives apply no force until the next step, shape (N,)."""
        model, ids = self._model, self._ctrl
        offset, per_rad, per_rad_s = model.actuator_biasprm[ids, :3].T
        force = offset + per_rad * self.position_rad + per_rad_s * self.velocity_rad_s
        return np.asarray(-force / model.actuator_gainprm[ids, 0])

    def set_command(self, values: FloatArray) -> None:
        """Command the actuators, shape (N,); the limits of the model apply."""
        self._data.ctrl[self._ctrl] = values

    def set_position(self, values: FloatArray) -> None:
        """Set the joint positions at rest, shape (N,). Call ``mj_forward`` when all is set."""
        self._data.qpos[self._qpos] = values
        self._data.qvel[self._dof] = 0.0


def _drive(model: mujoco.MjModel, actuator: int) -> str:
    if model.actuator_biastype[actuator] != mujoco.mjtBias.mjBIAS_AFFINE:
        return "torque"
    return "position" if model.actuator_biasprm[actuator, 1] < 0 else "velocity"

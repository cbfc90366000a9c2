"""Actuators of the model as a device with the interface of a servo bus."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from joshua.api import Actuator, ActuatorContext, ConfigurationError, DeviceError, FloatArray, JointReading
from joshua.api.motions import FileMotion, Motion, SineMotion

from joshua_mujoco_sim.actuator_group import ActuatorGroup
from joshua_mujoco_sim.model_file import ModelError
from joshua_mujoco_sim.physics import Physics
from joshua_mujoco_sim.position_loop import Gains
from joshua_mujoco_sim.settings import SimActuatorSettings, SimulationSettings
from joshua_mujoco_sim.world import World, leave_world, shared_world

if TYPE_CHECKING:
    from joshua_mujoco_sim.calibration_target import SimCalibrationTarget

#: No-load speed of a small serial bus servo at 12 V, as modelled.
VELOCITY_MAX_RAD_S = 4.7


class SimActuator(Actuator):
    """A group of actuators of the simulated model.

    With torque on, a joint moves to its goal by the position drive of the model, or by a position loop around
    its force or velocity drive (a wheel, a motor). After a release the drive applies no force: the arm falls
    against its gear friction and can be pushed. Until the first ``enable`` or ``release`` it is braked at its
    initial position. A configured motion replaces both. Effort is the force on the joint, N·m or N.

    Args:
        settings: of the actuators.
        context: of its node; its facts hold the settings of the simulation.
    """

    settings: SimActuatorSettings
    velocity_max_rad_s = VELOCITY_MAX_RAD_S

    def __init__(self, settings: SimActuatorSettings, context: ActuatorContext | None = None) -> None:
        super().__init__(settings, context)
        joints = settings.frames()
        self._zero = np.array([joint.zero_rad for joint in joints])
        self._sign = np.array([joint.sign for joint in joints])
        self._world: World | None = None
        self._group: ActuatorGroup | None = None
        self._goal: FloatArray | None = None
        self._is_free = False
        self._motion: Motion | None = None
        self._motion_start_s = 0.0
        self._stamps = self.context.clock
        self._unhook: Any = None
        self._demonstrator: Any = None

    @property
    def connected(self) -> bool:
        """Whether this is part of a running simulation."""
        return self._world is not None

    def connect(self) -> None:
        """Join the simulation with torque off. Raises DeviceError, ConfigurationError for a wrong model."""
        if self.connected:
            raise DeviceError("SimActuator.connect: the device is already open")
        simulation = self.context.facts.simulation
        if not simulation:
            raise ConfigurationError(
                "SimActuator.connect: the configuration has no simulation block: add one"
            )
        motion = self._make_motion()
        world = shared_world(SimulationSettings.model_validate(simulation).world())
        try:
            with world.lock:
                self._join(world, motion)
        except ModelError:
            leave_world(world)
            raise
        world.start()

    def read(self) -> JointReading:
        """Return position, speed and force of all joints."""
        world, group = self._joined("read")
        if world.failure:
            raise DeviceError(world.failure)
        with world.lock:
            position, velocity, force = self._angles(group), group.velocity_rad_s, group.torque
            if self._demonstrator is not None:
                position = self._sign * (self._demonstrator.goal - self._zero)
            stamp_ns = self._stamps.now_ns()  # no step may come between the values and their time
        return JointReading(stamp_ns, position, self._sign * velocity, self._sign * force)

    def enable(self) -> None:
        """Enable the torque of all joints at their present positions."""
        world, group = self._joined("enable")
        with world.lock:
            self._goal = self._angles(group)

    def write(self, goal_rad: FloatArray) -> FloatArray:
        """Command positions in radians, shape (N,). Return the goal after the clamp.

        Raises ValueError for a wrong shape or a value that is not finite, DeviceError without torque.
        """
        world, _ = self._joined("write")
        goal = self.checked_goal(goal_rad)
        if self._goal is None:
            raise DeviceError("SimActuator.write: the joints have no torque: call enable first")
        goal = self.limits.clip(goal)
        with world.lock:
            self._goal = goal
        return goal.copy()

    def hold(self) -> None:
        """Stop the joints at their positions without changing the torque."""
        world, group = self._joined("hold")
        with world.lock:
            if self._goal is not None:
                self._goal = self._angles(group)

    def release(self) -> None:
        """Disable torque; no effect on a closed device."""
        if self._world is not None:
            with self._world.lock:
                self._goal, self._is_free = None, True

    def read_torque(self) -> dict[str, bool]:
        """Return whether the drives of the joints have a goal."""
        world, _ = self._joined("read_torque")
        with world.lock:
            return dict.fromkeys(self.joint_names, self._goal is not None)

    def disconnect(self) -> None:
        """Leave the simulation and the drives unchanged. Idempotent."""
        world, self._world = self._world, None
        if world is None:
            return
        if self._unhook is not None:
            self._unhook()
        self._group = self._goal = self._motion = self._unhook = self._demonstrator = None
        leave_world(world)

    def _join(self, world: World, motion: Motion | None) -> None:
        group = world.physics.group(self.settings.actuators)
        for drive in self.settings.drives:
            place = group.place_of(drive.joint)
            if place is not None:
                group.set_gains(place, Gains(drive.position_gain, drive.velocity_gain))
        self._group, self._motion, self._goal, self._is_free = group, motion, None, False
        self._motion_start_s = world.physics.time_s
        self._world = world
        if self.settings.demonstrate:
            from joshua_mujoco_sim.demonstrating import Demonstrator

            settings = self.settings
            self._demonstrator = Demonstrator(
                world, settings.demonstrate, settings.noise_rad, settings.recoveries
            )
            world.demonstrator = self._demonstrator
            self._unhook = world.before_step(self._demonstrator.advance)
            return
        self._unhook = world.before_step(self._drive)

    def _drive(self, physics: Physics) -> None:
        """Set the goals of the drives (before each step, under the lock)."""
        group = self._group
        if group is None:
            return
        position = group.position_rad
        goal = self._goal
        if goal is None and self._motion is not None:
            goal = self._own_motion(physics)
        if goal is None and self._is_free:
            group.let_go()
            return
        group.set_command(position if goal is None else self._zero + self._sign * goal)

    def _angles(self, group: ActuatorGroup) -> FloatArray:
        """Return the joint positions about their zeros. The caller holds the lock."""
        angles: FloatArray = self._sign * (group.position_rad - self._zero)
        return angles

    def _own_motion(self, physics: Physics) -> FloatArray:
        assert self._motion is not None
        if physics.time_s < self._motion_start_s:  # the simulation was reset
            self._motion_start_s = physics.time_s
        goal, _ = self._motion.at(physics.time_s - self._motion_start_s)
        return self.limits.clip(goal)

    def calibration_target(self) -> SimCalibrationTarget:
        """Return the calibration target: the joints that turn between stops, and a simulated hand."""
        simulation = self.context.facts.simulation
        if not simulation or not any(joint["by_hand"] for joint in self.settings.joint_ranges):
            return super().calibration_target()  # type: ignore[no-any-return]
        from joshua_mujoco_sim.calibration_target import SimCalibrationTarget

        return SimCalibrationTarget(self.settings, simulation)

    def _make_motion(self) -> Motion | None:
        settings = self.settings
        if settings.motion == "sine":
            return SineMotion(self.limits, settings.motion_amplitude_rad, settings.motion_frequency_hz)
        if settings.motion == "file":
            return FileMotion(settings.motion_file, self.joint_names)
        return None

    def _joined(self, verb: str) -> tuple[World, ActuatorGroup]:
        self.require_connected(verb)
        assert self._world is not None
        assert self._group is not None
        return self._world, self._group

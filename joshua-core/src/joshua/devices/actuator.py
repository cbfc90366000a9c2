"""The base class of actuators: a group of joints that one node drives."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from joshua.devices.context import ActuatorContext, Device
from joshua.devices.diagnostics import DiagnosticStatus
from joshua.devices.errors import DeviceDisconnected as DeviceDisconnected
from joshua.devices.errors import DeviceError as DeviceError
from joshua.devices.errors import DeviceSilent as DeviceSilent
from joshua.devices.errors import SafetyTripped as SafetyTripped
from joshua.guardian.safe_stop import SafeStopRequest
from joshua.plan.facts import ActuatorFacts

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class JointLimits:
    """Limits of all joints, shape (N,), in joint order: the tightest of file, calibration and device."""

    position_min_rad: FloatArray
    position_max_rad: FloatArray
    velocity_max_rad_s: FloatArray

    def clip(self, position_rad: FloatArray) -> FloatArray:
        """Positions within the limits, shape (N,)."""
        return np.clip(position_rad, self.position_min_rad, self.position_max_rad)


@dataclass(frozen=True)
class JointReading:
    """State of all joints at one time.

    Attributes:
        stamp_ns: acquisition time, ns since the epoch.
        position_rad, velocity_rad_s: shape (N,).
        effort: N·m, or the fraction of stall torque if the device has no torque sensor, shape (N,).
    """

    stamp_ns: int
    position_rad: FloatArray
    velocity_rad_s: FloatArray
    effort: FloatArray


class Actuator(Device):
    """A group of joints. Written stop-first: ``release`` and ``disconnect`` work in every state.

    Order: constructor (no I/O) → ``connect`` → ``read``… → ``enable`` → ``write``/``read``… →
    ``hold`` or ``release`` → ``disconnect``. ``disconnect`` is idempotent and leaves no thread and no
    file handle. ``joint_names`` and ``limits`` are known without a connection.

    Args:
        settings: the model that its ``ActuatorSpec`` names.
        context: of the node that drives it; None for a driver outside a run.
    """

    def __init__(self, settings: Any, context: ActuatorContext | None = None) -> None:
        self.settings = settings
        self.context = context or ActuatorContext(ActuatorFacts())
        self._joint_names: tuple[str, ...] | None = None
        self._limits: JointLimits | None = None

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in joint order: those of its ``ActuatorSettings``."""
        if self._joint_names is None:  # read in each control cycle
            self._joint_names = tuple(joint.name for joint in self.settings.joints())
        return self._joint_names

    @property
    def velocity_max_rad_s(self) -> float | FloatArray:
        """Top speed of the joints, one value or shape (N,); each driver sets it."""
        raise NotImplementedError(f"{type(self).__name__} has no top speed: set velocity_max_rad_s")

    @property
    def limits(self) -> JointLimits:
        """Limits that ``write`` honours: the ranges of its settings' joints, and its top speed.

        Override it only for a device that narrows them once it is connected.
        """
        if self._limits is None:
            joints = self.settings.joints()
            self._limits = JointLimits(
                np.array([joint.min_rad for joint in joints], np.float64),
                np.array([joint.max_rad for joint in joints], np.float64),
                np.full(len(joints), self.velocity_max_rad_s),
            )
        return self._limits

    @abstractmethod
    def read(self) -> JointReading:
        """Reads the state of all joints.

        Raises:
            DeviceDisconnected: the device is disconnected.
            DeviceSilent: no reply; the node reads again, and fails if that continues.
            SafetyTripped: a protection has just switched the torque off. Reading still works afterwards.
        """

    def prepare(self) -> None:
        """Clears latched faults of the device before its torque is enabled. Raises DeviceError."""

    @abstractmethod
    def enable(self) -> None:
        """Energises the joints where they are: the goal is seeded with the present position first."""

    @abstractmethod
    def write(self, goal_rad: FloatArray) -> FloatArray:
        """Commands positions, shape (N,). Returns the goal written after clamp and rate limit.

        Raises ValueError for a wrong shape or a value that is not finite.
        """

    @abstractmethod
    def hold(self) -> None:
        """Stops the joints at their present positions. Does not change the torque."""

    @abstractmethod
    def release(self) -> None:
        """Switches the torque of all joints off."""

    @property
    def relaxed(self) -> Mapping[str, str]:
        """Joints whose torque alone a protection switched off, with the reason, by name.

        ``write`` and ``hold`` skip them until ``rejoin``.
        """
        return {}

    def rejoin(self) -> None:
        """Energises the relaxed joints where they are. Raises DeviceError, also while the cause persists."""

    def check(self) -> None:
        """Checks again that the open device is the right one and works. Raises DeviceError."""

    def read_torque(self) -> dict[str, bool] | None:
        """Reads back which joints have torque, by name; None if the device cannot report it.

        Raises DeviceDisconnected.
        """
        return None

    def safe_stop_request(
        self, action: str, *, park_pose_rad: Sequence[float] = (), timeout_s: float = 2.0
    ) -> SafeStopRequest:
        """The request that applies the safe state without this driver, of the class that the plugin names.

        Args:
            action: ``HOLD``, ``RELEASE`` or ``PARK_THEN_RELEASE``; park_pose_rad: of that, shape (N,).
            timeout_s: time limit.

        Raises:
            NotImplementedError: the plugin names a safe-stop action, but its driver does not implement it.
        """
        raise NotImplementedError(
            f"{type(self).__name__} does not implement its safe stop: override safe_stop_request"
        )

    def diagnostics(self) -> Sequence[DiagnosticStatus]:
        """The rows of ``/diagnostics`` for the device, once a second: one for each part, as last read.

        Called between two control cycles: do no input or output here. None by default. The node adds a row
        for the whole actuator, and one for each joint if there are no rows.
        """
        return ()

    @property
    def further_types(self) -> tuple[str, ...]:
        """Further ROS 2 types that it can publish, such as ``sensor_msgs/msg/BatteryState``."""
        return ()

    def further_message(self, type_name: str, frame_id: str) -> Any | None:
        """A message of one of ``further_types``, as last read; None before the first reading.

        Called between two control cycles: do no input or output here.
        """
        raise NotImplementedError(f"{type(self).__name__} declares {type_name} but does not implement it")

    def calibration_target(self) -> Any:
        """The target of a calibration, which opens the device itself. This object stays unconnected.

        It is a ``CalibrationTarget`` of the distribution ``joshua-calibration``; import it in this method,
        because a driver runs without it.

        Raises:
            NotImplementedError: the device needs no calibration.
        """
        raise NotImplementedError(f"{type(self).__name__} cannot be calibrated: override calibration_target")

    def checked_goal(self, goal_rad: FloatArray) -> FloatArray:
        """Returns a goal as a new float array of shape (N,).

        Raises:
            ValueError: the shape differs, or a value is not finite. The message names the joint.
        """
        names = self.joint_names
        goal = np.array(goal_rad, dtype=np.float64)
        if goal.shape != (len(names),):
            raise ValueError(
                f"{type(self).__name__}.write: the goal has shape {goal.shape}; "
                f"{len(names)} joints ({', '.join(names)}) need ({len(names)},)"
            )
        values = goal.tolist()  # faster than array operations for a few joints
        if not all(map(math.isfinite, values)):
            index = next(i for i, value in enumerate(values) if not math.isfinite(value))
            raise ValueError(
                f"{type(self).__name__}.write: the goal of {names[index]} is {goal[index]}; "
                "a position in radians is a finite number"
            )
        return goal

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
    """State of all joints at one acquisition.

    Attributes:
        stamp_ns: acquisition time, ns since the epoch.
        position_rad, velocity_rad_s: shape (N,).
        effort: N·m, or the fraction of stall torque where the device has no torque sensor, shape (N,).
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
        if self._joint_names is None:  # asked in each control cycle
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
            DeviceDisconnected: the device is gone.
            DeviceSilent: it did not answer; the node reads again, and fails where that lasts.
            SafetyTripped: a protection has just taken the torque off; reading goes on after that.
        """

    def prepare(self) -> None:
        """Clears what the device keeps of faults that are over, before it gets torque. Raises DeviceError."""

    @abstractmethod
    def enable(self) -> None:
        """Energises the joints where they are: the goal is seeded with the present position first."""

    @abstractmethod
    def write(self, goal_rad: FloatArray) -> FloatArray:
        """Commands positions, shape (N,); returns what was really written after clamp and rate limit.

        Raises ValueError for a wrong shape or a value that is not finite.
        """

    @abstractmethod
    def hold(self) -> None:
        """Stops where the joints are, torque as it is."""

    @abstractmethod
    def release(self) -> None:
        """Takes torque off all joints."""

    @property
    def relaxed(self) -> Mapping[str, str]:
        """Joints whose torque a protection took off while the others keep theirs, and why; by joint name.

        ``write`` and ``hold`` leave them out until ``rejoin``.
        """
        return {}

    def rejoin(self) -> None:
        """Energises the relaxed joints where they are. Raises DeviceError, also while the cause lasts."""

    def check(self) -> None:
        """Looks once more whether the open device is the right one and in order. Raises DeviceError."""

    def read_torque(self) -> dict[str, bool] | None:
        """Reads back which joints have torque, by name; None where the device cannot say.

        Raises DeviceDisconnected.
        """
        return None

    def safe_stop_request(
        self, action: str, *, park_pose_rad: Sequence[float] = (), timeout_s: float = 2.0
    ) -> SafeStopRequest:
        """What brings the device into its safe state without this driver, of the class that the plugin names.

        Args:
            action: ``HOLD``, ``RELEASE`` or ``PARK_THEN_RELEASE``; park_pose_rad: of that, shape (N,).
            timeout_s: by when it is to be done.

        Raises:
            NotImplementedError: the plugin names a safe-stop action, and its driver does not prepare it.
        """
        raise NotImplementedError(f"{type(self).__name__} prepares no safe stop: override safe_stop_request")

    def diagnostics(self) -> Sequence[DiagnosticStatus]:
        """What ``/diagnostics`` says of the device once a second: one row for each part, as last read.

        Called between two control cycles: no input or output here. None by default; the node adds a row for
        the whole actuator, and one for each joint where there are none.
        """
        return ()

    @property
    def further_types(self) -> tuple[str, ...]:
        """ROS 2 types that it can publish besides its joints, such as ``sensor_msgs/msg/BatteryState``."""
        return ()

    def further_message(self, type_name: str, frame_id: str) -> Any | None:
        """A message of one of ``further_types``, as last read; None while nothing was read.

        Called between two control cycles: no input or output here.
        """
        raise NotImplementedError(f"{type(self).__name__} offers {type_name} and does not make it")

    def calibration_target(self) -> Any:
        """What a calibration works on, which opens the device itself; this object stays unconnected.

        It is a ``CalibrationTarget`` of the distribution ``joshua-calibration``; import that here, so that
        a driver runs without it.

        Raises:
            NotImplementedError: the device has nothing to calibrate.
        """
        raise NotImplementedError(f"{type(self).__name__} cannot be calibrated: override calibration_target")

    def checked_goal(self, goal_rad: FloatArray) -> FloatArray:
        """Returns a goal as a new float array of shape (N,).

        Raises:
            ValueError: the shape is another one, or a value is not finite; says which joint.
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

"""Interface of an actuator for calibration: encoder positions with torque off, and stored values."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from joshua.api.calibration import TICKS_PER_TURN, ArmCalibration

#: Moves joints in place of the user during a calibration, see ``DeviceEmulator.guide``.
Hand = Callable[[int | None, float], bool]


@dataclass(frozen=True)
class TargetMotor:
    """One motor that the user moves by hand.

    Attributes:
        id: on the bus.
        joint_name: default name without an earlier calibration.
        ticks_per_turn: of the encoder; zero radians is in the middle, at ``ticks_per_turn / 2``.
        full_turn: the joint turns without stops, such as some wrists.
        typical_range_ticks: range of the joint in arms of this model; 0 if unknown.
        largest_offset: largest homing offset that the motor can store, to either side.
    """

    id: int
    joint_name: str
    ticks_per_turn: int = TICKS_PER_TURN
    full_turn: bool = False
    typical_range_ticks: int = 0
    largest_offset: int = TICKS_PER_TURN // 2 - 1


@dataclass(frozen=True)
class StoredMotor:
    """The stored calibration values of one motor, in ticks.

    Attributes:
        homing_offset: subtracted from the encoder position.
        range_min, range_max: allowed positions, homing offset applied.
    """

    homing_offset: int
    range_min: int
    range_max: int


class CalibrationTarget(ABC):
    """The interface of an actuator for a calibration. It never enables torque.

    Order: ``connect`` → ``release`` → ``raw_positions``… → ``store`` for each motor → ``disconnect``.
    ``motors`` is known without a connection. Only ``store`` changes values in the device, so an aborted
    calibration leaves the old one valid.
    """

    @property
    @abstractmethod
    def motors(self) -> tuple[TargetMotor, ...]:
        """The motors, in joint order."""

    @property
    @abstractmethod
    def identity(self) -> str:
        """Stable identity of the device, such as ``usb:5A46082345``; "" while unknown."""

    @property
    @abstractmethod
    def connected(self) -> bool:
        """Whether the device is open."""

    @abstractmethod
    def connect(self) -> None:
        """Open the device and check its motors, regardless of their calibration; write nothing.

        After a disconnection, find the same device again under any name.

        Raises:
            DeviceError: one of its kinds, with cause and remedy.
        """

    @abstractmethod
    def disconnect(self) -> None:
        """Close the device. Idempotent."""

    @abstractmethod
    def release(self) -> None:
        """Disable the torque of all motors, verified. Raises DeviceError."""

    @abstractmethod
    def raw_positions(self) -> tuple[int, ...]:
        """Return encoder positions in joint order, 0 to ``ticks_per_turn - 1``, without homing offset.

        Raises:
            DeviceDisconnected: a motor or the device does not reply.
        """

    @abstractmethod
    def stored(self) -> tuple[StoredMotor, ...] | None:
        """Return the values stored in the motors, in joint order; None for a device that stores nothing.

        Raises DeviceError.
        """

    @abstractmethod
    def store(self, motor_id: int, values: StoredMotor) -> None:
        """Write one motor's values and read them back; no effect for a device that stores nothing.

        Called with torque off. After a failure the motor may hold old values, new values or a mix; the caller
        restores what ``stored`` returned.

        Raises:
            DeviceError: a value was not stored, or the device is gone.
        """

    @property
    def hand(self) -> Hand | None:
        """Motion source of an emulated or simulated device; None if the user moves the joints."""
        return None

    def misfits(self, calibration: ArmCalibration) -> Sequence[str]:
        """Return contradictions between a calibration and this device, one sentence each, without full stop.

        For a device that stores nothing but knows its joints; stored values are compared anyway.
        """
        del calibration
        return ()


SO_ARM_JOINTS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
_SO_ARM_RANGE_TICKS = (2869, 2178, 2048, 2477, 0, 1434)  # from the public model; the roll has no stops
_ROLL = "wrist_roll"


def arm_motors(ids: Sequence[int]) -> tuple[TargetMotor, ...]:
    """Return motors with 4096 ticks per turn; six get the names of an SO-ARM100, others names by id."""
    if len(ids) != len(SO_ARM_JOINTS):
        return tuple(TargetMotor(motor_id, f"joint_{motor_id}") for motor_id in ids)
    return tuple(
        TargetMotor(motor_id, name, full_turn=name == _ROLL, typical_range_ticks=ticks)
        for motor_id, name, ticks in zip(ids, SO_ARM_JOINTS, _SO_ARM_RANGE_TICKS, strict=True)
    )

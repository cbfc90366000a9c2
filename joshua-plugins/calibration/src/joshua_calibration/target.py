"""The interface of an actuator for a calibration: encoder positions without torque, and stored values."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from joshua.api.calibration import TICKS_PER_TURN, ArmCalibration

#: Moves joints as a calibration asks a person to, see ``DeviceEmulator.guide``.
Hand = Callable[[int | None, float], bool]


@dataclass(frozen=True)
class TargetMotor:
    """One motor that a person moves by hand.

    Attributes:
        id: on the bus.
        joint_name: name where no earlier calibration gives one.
        ticks_per_turn: of the encoder; zero radians stand in the middle, at ``ticks_per_turn / 2``.
        full_turn: the joint may go round without end, such as a wrist without stops.
        typical_range_ticks: range of the joint in arms of this build; 0 where unknown.
        largest_offset: largest homing offset that the motor can keep, to either side.
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
        homing_offset: what is subtracted from the encoder position.
        range_min, range_max: positions that the motor allows, homing offset applied.
    """

    homing_offset: int
    range_min: int
    range_max: int


class CalibrationTarget(ABC):
    """The interface of an actuator for a calibration. It never enables torque.

    Order: ``connect`` → ``release`` → ``raw_positions``… → ``store`` for each motor → ``disconnect``.
    ``motors`` is known without a connection. Only ``store`` changes values in the device, so a calibration
    that ends earlier leaves the old one valid.
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
        """Open the device and check its motors, whatever calibration they hold; write nothing.

        After a disconnection the same device is looked for, under whatever name it came back.

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
        """Encoder positions in joint order, 0 to ``ticks_per_turn - 1``, no homing offset applied.

        Raises:
            DeviceDisconnected: a motor or the device does not answer.
        """

    @abstractmethod
    def stored(self) -> tuple[StoredMotor, ...] | None:
        """The values stored in the motors, in joint order; None for a device that stores nothing.

        Raises DeviceError.
        """

    @abstractmethod
    def store(self, motor_id: int, values: StoredMotor) -> None:
        """Write one motor's values and read them back; for a device that keeps nothing it does nothing.

        Called with torque off. Where it fails, the motor may hold old, new or some of each: the caller puts
        back what ``stored`` has said.

        Raises:
            DeviceError: a value was not kept, or the device is gone.
        """

    @property
    def hand(self) -> Hand | None:
        """What moves the joints of a device that nobody can take by the hand; None if a person does."""
        return None

    def misfits(self, calibration: ArmCalibration) -> Sequence[str]:
        """What of a calibration cannot be true of this device, one sentence without a full stop each.

        For a device that keeps nothing and still knows its joints; what motors keep is compared anyway.
        """
        del calibration
        return ()


SO_ARM_JOINTS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
_SO_ARM_RANGE_TICKS = (2869, 2178, 2048, 2477, 0, 1434)  # of the public model; the roll has no stops
_ROLL = "wrist_roll"


def arm_motors(ids: Sequence[int]) -> tuple[TargetMotor, ...]:
    """Motors of an arm of 4096 ticks a turn: six are named as those of an SO-ARM100, others by their ids."""
    if len(ids) != len(SO_ARM_JOINTS):
        return tuple(TargetMotor(motor_id, f"joint_{motor_id}") for motor_id in ids)
    return tuple(
        TargetMotor(motor_id, name, full_turn=name == _ROLL, typical_range_ticks=ticks)
        for motor_id, name, ticks in zip(ids, SO_ARM_JOINTS, _SO_ARM_RANGE_TICKS, strict=True)
    )

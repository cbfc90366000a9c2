"""Clauses about the values of a calibration target: motors, positions and stored values."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress

from joshua.api import DeviceError
from joshua.api.calibration import LARGEST_OFFSET, TICKS_PER_TURN
from joshua.testing import lifecycle
from joshua.testing.conformance import ViolationError, require

from joshua_calibration.target import CalibrationTarget, StoredMotor, TargetMotor

#: Largest change of a joint at rest between two readings, in turns: noise, and an arm that settles.
STILL = 1 / 64

#: Largest id that a calibration file can store.
LARGEST_ID = 253


def check_motor(motor: TargetMotor) -> None:
    """A calibration file can store the motor."""
    name = motor.joint_name
    require(
        bool(name) and isinstance(name, str) and 0 <= motor.id <= LARGEST_ID,
        f"a motor has the id {motor.id!r} and the joint_name {name!r}",
        why=f"a calibration file stores ids from 0 to {LARGEST_ID}, each with a name",
        cause="the id is not the motor's id on the bus, or a name is empty",
    )
    require(
        1 < motor.ticks_per_turn <= TICKS_PER_TURN,
        f"{name} has {motor.ticks_per_turn} ticks a turn",
        why=f"a calibration file stores ranges of at most {TICKS_PER_TURN} ticks",
        cause="the target does not scale a finer encoder to 4096 ticks a turn",
    )
    half = motor.ticks_per_turn // 2
    require(
        half - 1 <= motor.largest_offset <= max(LARGEST_OFFSET, half - 1),
        f"{name} has a largest_offset of {motor.largest_offset}",
        why=f"with {motor.ticks_per_turn} ticks a turn, a middle pose may need an offset of up to {half - 1}",
        cause="largest_offset is still the default for another number of ticks, or the register cannot "
        "store half a turn",
    )
    require(
        0 <= motor.typical_range_ticks <= motor.ticks_per_turn,
        f"{name} has a typical range of {motor.typical_range_ticks} ticks",
        why="a calibration rejects a range far smaller than the typical one",
        cause="the value is in degrees or radians instead of ticks. Use 0 if the typical range is unknown",
    )


def check_positions(positions: object, motors: Sequence[TargetMotor]) -> None:
    """Positions are whole ticks within a turn, one for each motor."""
    whole = isinstance(positions, tuple) and len(positions) == len(motors)
    require(
        whole and all(type(value) is int for value in positions),  # type: ignore[attr-defined]
        f"raw_positions() is {positions!r} for {len(motors)} motors",
        why="each motor has one position, in whole ticks and in joint order",
        cause="raw_positions omits a motor that does not reply instead of raising DeviceDisconnected, or "
        "it returns an array",
    )
    assert isinstance(positions, tuple)
    for motor, value in zip(motors, positions, strict=True):
        require(
            0 <= value < motor.ticks_per_turn,
            f"{motor.joint_name} reads {value}, allowed 0 to {motor.ticks_per_turn - 1}",
            why="the calibration itself tracks the encoder across the end of a turn",
            cause="raw_positions applies the homing offset without wrapping to zero, or counts turns",
        )


def check_kept(target: CalibrationTarget, expected: Sequence[StoredMotor], motor: TargetMotor) -> None:
    """The motors store the expected values after a write to one of them."""
    found = target.stored()
    require(
        found == tuple(expected),
        f"after store of {motor.joint_name}, the motors store {found}; expected {tuple(expected)}",
        why="a run refuses an arm whose motors store values other than those of the file",
        cause="store skips a register, uses the wrong width or sign, or writes to another motor",
    )


def check_still(
    motors: Sequence[TargetMotor], before: Sequence[int], after: Sequence[int], stored: TargetMotor
) -> None:
    """A stored offset does not change an encoder position."""
    for motor, was, now in zip(motors, before, after, strict=True):
        half = motor.ticks_per_turn // 2
        way = abs((now - was + half) % motor.ticks_per_turn - half)
        require(
            way <= motor.ticks_per_turn * STILL,
            f"{motor.joint_name} read {was} before store of {stored.joint_name} and {now} after it",
            why="raw positions are those of the encoder and must not depend on the offset",
            cause="the motor applies its new offset to its reading, and raw_positions does not subtract it",
        )


def sample_value(motor: TargetMotor, index: int) -> StoredMotor:
    """A value that differs between motors. Among them are both limits of an offset."""
    turn, sign = motor.ticks_per_turn, 1 if index % 2 else -1
    return StoredMotor(sign * (motor.largest_offset - index), turn // 8 + index, turn * 7 // 8 - index)


@contextmanager
def kept_in_the_end(
    factory: Callable[[], CalibrationTarget], target: CalibrationTarget, old: Sequence[StoredMotor]
) -> Iterator[None]:
    """Restore the old values of the motors, and close the target. Raises ViolationError."""
    try:
        yield
    except BaseException:
        with suppress(Exception):  # the first failure is more informative
            _put_back(factory, target, old)
        raise
    _put_back(factory, target, old)


def _put_back(
    factory: Callable[[], CalibrationTarget], target: CalibrationTarget, old: Sequence[StoredMotor]
) -> None:
    target.disconnect()
    with lifecycle.opened(factory) as target:
        target.release()
        for motor, value in zip(target.motors, old, strict=True):
            try:
                target.store(motor.id, value)
            except DeviceError as error:
                raise ViolationError(
                    f"the old values of {motor.joint_name} could not be restored: {error}",
                    "if a write fails, the calibration restores the old values",
                    "store refuses values that the motor itself has stored",
                ) from error

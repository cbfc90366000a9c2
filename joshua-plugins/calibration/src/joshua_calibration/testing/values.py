"""Clauses about the values of a calibration target: motors, positions, and what motors keep."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress

from joshua.api import DeviceError
from joshua.api.calibration import LARGEST_OFFSET, TICKS_PER_TURN
from joshua.testing import lifecycle
from joshua.testing.conformance import ViolationError, require

from joshua_calibration.target import CalibrationTarget, StoredMotor, TargetMotor

#: How far a joint that nobody moves may go between two readings: noise, and an arm that settles.
STILL = 1 / 64

#: Largest id that a calibration file keeps.
LARGEST_ID = 253


def check_motor(motor: TargetMotor) -> None:
    """A motor fits into a calibration file."""
    name = motor.joint_name
    require(
        bool(name) and isinstance(name, str) and 0 <= motor.id <= LARGEST_ID,
        f"a motor has the id {motor.id!r} and the joint_name {name!r}",
        why=f"a calibration file keeps ids from 0 to {LARGEST_ID} and a name for each",
        cause="the id is not that of the bus, or a name is left empty",
    )
    require(
        1 < motor.ticks_per_turn <= TICKS_PER_TURN,
        f"{name} has {motor.ticks_per_turn} ticks a turn",
        why=f"a calibration file holds ranges of at most {TICKS_PER_TURN} ticks",
        cause="a finer encoder is not scaled to 4096 ticks a turn",
    )
    half = motor.ticks_per_turn // 2
    require(
        half - 1 <= motor.largest_offset <= max(LARGEST_OFFSET, half - 1),
        f"{name} has a largest_offset of {motor.largest_offset}",
        why=f"with {motor.ticks_per_turn} ticks a turn any middle pose needs up to {half - 1}",
        cause="largest_offset was left at its default for another number of ticks, or is that of a register "
        "that cannot hold half a turn",
    )
    require(
        0 <= motor.typical_range_ticks <= motor.ticks_per_turn,
        f"{name} has a typical range of {motor.typical_range_ticks} ticks",
        why="a range is refused that is far smaller than the typical one",
        cause="degrees or radians are given in place of ticks; 0 says that it is unknown",
    )


def check_positions(positions: object, motors: Sequence[TargetMotor]) -> None:
    """Positions are whole ticks within a turn, one for each motor."""
    whole = isinstance(positions, tuple) and len(positions) == len(motors)
    require(
        whole and all(type(value) is int for value in positions),  # type: ignore[attr-defined]
        f"raw_positions() is {positions!r} for {len(motors)} motors",
        why="each motor has one position, in whole ticks and in joint order",
        cause="a motor that does not answer is left out in place of raising DeviceDisconnected, or an array "
        "is handed out",
    )
    assert isinstance(positions, tuple)
    for motor, value in zip(motors, positions, strict=True):
        require(
            0 <= value < motor.ticks_per_turn,
            f"{motor.joint_name} reads {value}, beyond 0 to {motor.ticks_per_turn - 1}",
            why="a calibration follows the encoder over the end of its turn by itself",
            cause="the homing offset is applied without starting again at zero, or turns are counted",
        )


def check_kept(target: CalibrationTarget, expected: Sequence[StoredMotor], motor: TargetMotor) -> None:
    """The motors keep what is expected after one of them was written."""
    found = target.stored()
    require(
        found == tuple(expected),
        f"after store of {motor.joint_name} the motors keep {found}; expected {tuple(expected)}",
        why="a run refuses an arm whose motors keep other values than the file",
        cause="a register is not written, holds fewer bits, has another sign, or that of another motor was "
        "written",
    )


def check_still(
    motors: Sequence[TargetMotor], before: Sequence[int], after: Sequence[int], stored: TargetMotor
) -> None:
    """Nothing that was stored shows in an encoder position."""
    for motor, was, now in zip(motors, before, after, strict=True):
        half = motor.ticks_per_turn // 2
        way = abs((now - was + half) % motor.ticks_per_turn - half)
        require(
            way <= motor.ticks_per_turn * STILL,
            f"{motor.joint_name} read {was} before store of {stored.joint_name} and {now} after it",
            why="raw positions are those of the encoder, whatever offset is in force",
            cause="the motor applies its new offset to what it reports, and it is not taken out again",
        )


def sample_value(motor: TargetMotor, index: int) -> StoredMotor:
    """A value that differs from motor to motor, with both ends of what an offset can be among them."""
    turn, sign = motor.ticks_per_turn, 1 if index % 2 else -1
    return StoredMotor(sign * (motor.largest_offset - index), turn // 8 + index, turn * 7 // 8 - index)


@contextmanager
def kept_in_the_end(
    factory: Callable[[], CalibrationTarget], target: CalibrationTarget, old: Sequence[StoredMotor]
) -> Iterator[None]:
    """Put back what the motors kept before; close the target. Raises ViolationError."""
    try:
        yield
    except BaseException:
        with suppress(Exception):  # what has failed already says more
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
                    f"the old values of {motor.joint_name} could not be put back: {error}",
                    "where writing fails the old calibration is put back",
                    "store refuses values that the motor itself has kept",
                ) from error

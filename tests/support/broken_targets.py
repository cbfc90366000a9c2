"""A calibration target whose device is a few numbers, and others that each break one clause."""

from __future__ import annotations

import itertools
import os
import time
from collections.abc import Sequence
from dataclasses import replace

from joshua.devices.calibration import ArmCalibration
from joshua.devices.errors import DeviceDisconnected, DeviceError
from joshua.devices.units import rad_to_ticks
from joshua_calibration.hand import Path, hand_paths
from joshua_calibration.target import CalibrationTarget, Hand, StoredMotor, TargetMotor

MOTORS = (
    TargetMotor(1, "shoulder", typical_range_ticks=2000),
    TargetMotor(2, "elbow", typical_range_ticks=2000),
)
FACTORY = StoredMotor(0, 0, 4095)


class Device:
    """Two motors with an EEPROM, and joints between -1.5 and 1.5 rad."""

    def __init__(self) -> None:
        self.kept = [FACTORY, FACTORY]
        self.paths: dict[int, Path] = {}
        self.angles = [0.4, -0.3]
        self.start_s = 0.0
        self.unplugged = False

    def positions(self) -> list[float]:
        elapsed_s = time.monotonic() - self.start_s
        for index, path in self.paths.items():
            self.angles[index] = path(elapsed_s)
        return self.angles

    def move(self, joint: int | None, seconds: float) -> bool:
        self.paths = hand_paths(joint, self.positions(), [(-1.5, 1.5)] * 2, seconds)
        self.start_s = time.monotonic()
        return True


class Target(CalibrationTarget):
    """Keeps the contract."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self.open = False

    @property
    def motors(self) -> tuple[TargetMotor, ...]:
        return MOTORS

    @property
    def identity(self) -> str:
        return "usb:TOY" if self.open else ""

    @property
    def connected(self) -> bool:
        return self.open

    def connect(self) -> None:
        self.open = True

    def disconnect(self) -> None:
        self.open = False

    def require_open(self) -> None:
        if not self.open:
            raise DeviceError("the toy is not open: call connect first")
        if self.device.unplugged:
            raise DeviceDisconnected("the toy is gone")

    def release(self) -> None:
        self.require_open()

    def raw_positions(self) -> tuple[int, ...]:
        self.require_open()
        return tuple(rad_to_ticks(angle) % 4096 for angle in self.device.positions())

    def stored(self) -> tuple[StoredMotor, ...] | None:
        self.require_open()
        return tuple(self.device.kept)

    def store(self, motor_id: int, values: StoredMotor) -> None:
        self.require_open()
        if motor_id not in (1, 2) or abs(values.homing_offset) > 2047:
            raise DeviceError(f"the toy cannot keep {values} in motor {motor_id}")
        self.device.kept[motor_id - 1] = values

    @property
    def hand(self) -> Hand:
        return self.device.move


class KeepsNothing(Target):
    """Keeps the contract, and no values."""

    def stored(self) -> None:
        return None

    def store(self, motor_id: int, values: StoredMotor) -> None:
        pass


class OpensInConstructor(Target):
    def __init__(self, device: Device) -> None:
        super().__init__(device)
        self.handle = os.open(os.devnull, os.O_RDONLY)

    def disconnect(self) -> None:
        super().disconnect()
        if self.handle >= 0:
            os.close(self.handle)
            self.handle = -1


class MotorsNeedConnection(Target):
    @property
    def motors(self) -> tuple[TargetMotor, ...]:
        self.require_open()
        return MOTORS


class NamesTwice(Target):
    @property
    def motors(self) -> tuple[TargetMotor, ...]:
        return (MOTORS[0], replace(MOTORS[1], joint_name="shoulder"))


class TooFine(Target):
    @property
    def motors(self) -> tuple[TargetMotor, ...]:
        return tuple(replace(motor, ticks_per_turn=16384) for motor in MOTORS)


class SmallOffset(Target):
    @property
    def motors(self) -> tuple[TargetMotor, ...]:
        return tuple(replace(motor, largest_offset=1000) for motor in MOTORS)


class RangeInDegrees(Target):
    @property
    def motors(self) -> tuple[TargetMotor, ...]:
        return tuple(replace(motor, typical_range_ticks=-180) for motor in MOTORS)


class ReadsWhenClosed(Target):
    def raw_positions(self) -> tuple[int, ...]:
        return (1, 2)


class NeverCloses(Target):
    def disconnect(self) -> None:
        pass


class NewIdentityEachTime(Target):
    counter = itertools.count()

    @property
    def identity(self) -> str:
        return f"usb:{next(self.counter)}"


class ReleasesOnce(Target):
    released = False

    def release(self) -> None:
        super().release()
        if self.released:
            raise DeviceError("there is no torque to take off")
        self.released = True


class LeavesOut(Target):
    def raw_positions(self) -> tuple[int, ...]:
        return super().raw_positions()[:1]


class CountsTurns(Target):
    def raw_positions(self) -> tuple[int, ...]:
        return tuple(value + 4096 for value in super().raw_positions())


class RepeatsTheFirstReading(Target):
    first: tuple[int, ...] = ()

    def raw_positions(self) -> tuple[int, ...]:
        self.first = self.first or super().raw_positions()
        return self.first


class MovesBoth(Target):
    def raw_positions(self) -> tuple[int, ...]:
        shoulder, _ = super().raw_positions()
        return (shoulder, shoulder)


class HandBlocks(Target):
    @property
    def hand(self) -> Hand:
        def move(joint: int | None, seconds: float) -> bool:
            time.sleep(seconds)
            return self.device.move(joint, seconds)

        return move


class HidesASign(Target):
    def stored(self) -> tuple[StoredMotor, ...] | None:
        kept = super().stored()
        assert kept is not None
        return tuple(replace(value, homing_offset=value.homing_offset or 65535) for value in kept)


class ResetsAtConnect(Target):
    def connect(self) -> None:
        super().connect()
        offset = self.device.kept[0].homing_offset + 1
        self.device.kept[0] = replace(FACTORY, homing_offset=offset)


class DropsTheRange(Target):
    def store(self, motor_id: int, values: StoredMotor) -> None:
        super().store(motor_id, replace(values, range_max=4095))


class ForgetsAtClose(Target):
    def disconnect(self) -> None:
        super().disconnect()
        self.device.kept = [FACTORY, FACTORY]


class ReportsWithOffset(Target):
    def raw_positions(self) -> tuple[int, ...]:
        offsets = [value.homing_offset for value in self.device.kept]
        return tuple((v - o) % 4096 for v, o in zip(super().raw_positions(), offsets, strict=True))


class CutsTheOffset(Target):
    def store(self, motor_id: int, values: StoredMotor) -> None:
        super().store(motor_id, replace(values, homing_offset=max(-2047, min(2047, values.homing_offset))))


class ChecksTooLate(Target):
    def store(self, motor_id: int, values: StoredMotor) -> None:
        self.require_open()
        if motor_id in (1, 2):
            kept = self.device.kept[motor_id - 1]
            self.device.kept[motor_id - 1] = replace(kept, range_max=values.range_max - 1)
        super().store(motor_id, values)


class OneText(Target):
    def misfits(self, calibration: ArmCalibration) -> Sequence[str]:
        return "nothing fits"


class ClosesOnce(Target):
    def disconnect(self) -> None:
        if not self.open:
            raise OSError("bad file descriptor")
        super().disconnect()


class LeavesAHandle(Target):
    def connect(self) -> None:
        super().connect()
        left_handles.append(os.open(os.devnull, os.O_RDONLY))


class SharesStateOnTheClass(Target):
    shared = False

    @property
    def connected(self) -> bool:
        return SharesStateOnTheClass.shared

    def connect(self) -> None:
        super().connect()
        SharesStateOnTheClass.shared = True

    def disconnect(self) -> None:
        super().disconnect()
        SharesStateOnTheClass.shared = False


class RepeatsAfterUnplug(Target):
    def require_open(self) -> None:
        if not self.open:
            super().require_open()


left_handles: list[int] = []

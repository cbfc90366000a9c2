"""Writes a calibration into an emulated arm and its file, and is ended at a step of one's choice.

Run as a program: ``calibration_writer.py PORT ROOT FILE STEP``; at the step of that number it kills itself.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path

from joshua.config.loading import journal_path
from joshua.devices.calibration import ArmCalibration, MotorCalibration
from joshua_calibration import arm_file, journal, transaction
from joshua_calibration.target import SO_ARM_JOINTS, StoredMotor
from joshua_sts3215.calibration_target import Sts3215CalibrationTarget
from joshua_sts3215.settings import Sts3215Settings
from patience import patient

NODE = "leader_arm"


def new_calibration(stamp: str = "2026-01-31T12:00:00Z", offset: int = 700) -> ArmCalibration:
    motors = tuple(
        MotorCalibration(
            id=i + 1, joint_name=name, homing_offset=offset + i, range_min=200 + i, range_max=3900 + i
        )
        for i, name in enumerate(SO_ARM_JOINTS)
    )
    return ArmCalibration(motors=motors, device_identity="usb:ARM1", calibrated_at=stamp)


class SteppedTarget(Sts3215CalibrationTarget):
    """Calls ``step`` before and after every register block that is written, and in the midst of each."""

    step: Callable[[], None] = staticmethod(lambda: None)

    def store(self, motor_id: int, values: StoredMotor) -> None:
        self.step()
        half = self.stored()[motor_id - 1]
        super().store(motor_id, StoredMotor(values.homing_offset, half.range_min, half.range_max))
        self.step()
        super().store(motor_id, values)
        self.step()


def open_target(port: str, root: str) -> SteppedTarget:
    settings = {"port": port, "device_root": root, "motor_ids": list(range(1, 7))}
    target = SteppedTarget(Sts3215Settings.model_validate(settings))
    patient(target._bus)
    target.connect()
    return target


def parts(path: Path) -> tuple[arm_file.ArmFile, journal.Journal]:
    return arm_file.ArmFile(path), journal.Journal(journal_path(str(path), NODE))


def main() -> None:
    port, root, path, last = sys.argv[1], sys.argv[2], Path(sys.argv[3]), int(sys.argv[4])
    count = 0

    def step() -> None:
        nonlocal count
        if count == last:
            os.kill(os.getpid(), signal.SIGKILL)
        count += 1

    def stepped(function: Callable[..., object]) -> Callable[..., object]:
        def run(*arguments: object) -> object:
            step()
            result = function(*arguments)
            step()
            return result

        return run

    # every point at which the outside world changes is a step
    target = open_target(port, root)
    target.step = step
    for owner, name in (
        (journal.Journal, "write"),
        (journal.Journal, "remove"),
        (arm_file.PreparedFile, "commit"),
    ):
        setattr(owner, name, stepped(getattr(owner, name)))
    file, note = parts(path)
    transaction.write(target, NODE, new_calibration(), file, note)
    sys.stdout.write(f"steps {count}\n")


if __name__ == "__main__":
    main()

"""Holds an object for five minutes: with grip mode, and as baseline without, at the same time on two buses.

``python tests/soak/grip.py [SECONDS]`` prints what became of both. It ends with 1 where grip mode tripped, or
where the baseline did not (then the emulated servo is no test of it).
"""

from __future__ import annotations

import sys
import time
from contextlib import ExitStack
from typing import Any

from joshua_emulator import EmulatedBus
from joshua_servo.arm import ServoArm
from joshua_servo.errors import NoReply, SafetyTripped
from joshua_sts3215.actuator import Sts3215Actuator
from joshua_sts3215.settings import Sts3215Settings

SECONDS = 300.0
PERIOD_S = 0.02
GRIPPER = 6
CLOSED_RAD = 0.1  # 5 degrees beyond the object, which begins 5 ticks further on


class Case:
    """A calibrated arm with an object between its jaws.

    Attributes:
        tripped_after_s: None while it holds.
    """

    def __init__(self, stack: ExitStack, name: str, joint: dict[str, Any]) -> None:
        self.name = name
        self.emulator = stack.enter_context(
            EmulatedBus("feetech", arm="so_arm100", calibrated=True, identity=name.upper())
        )
        present = self.emulator.servo(GRIPPER)["present_position"]
        self.emulator.ask("set", id=GRIPPER, object_ticks=present - 5)
        settings = Sts3215Settings.model_validate(
            {
                "port": self.emulator.port,
                "device_root": str(self.emulator.root),
                "motor_ids": [1, 2, 3, 4, 5, 6],
                "calibration": self.emulator.calibration(),
                "joint": [{"motor_id": GRIPPER, **joint}],
            }
        )
        self.arm: ServoArm = Sts3215Actuator(settings)
        self.arm.connect()
        stack.callback(self.arm.disconnect)
        self.arm.enable()
        self.goal = self.arm.read().position_rad
        self.goal[5] -= CLOSED_RAD
        self.began_s = time.monotonic()
        self.tripped_after_s: float | None = None

    def cycle(self) -> None:
        """One control cycle; none after a trip."""
        if self.tripped_after_s is not None:
            return
        try:
            self.arm.read()
            self.arm.write(self.goal)
        except NoReply:  # a busy machine: the node leaves such a cycle out, too
            return
        except SafetyTripped:
            self.tripped_after_s = time.monotonic() - self.began_s
        if self.arm.relaxed:
            self.tripped_after_s = time.monotonic() - self.began_s

    def report(self, seconds: float) -> str:
        """What became of it."""
        servo = self.emulator.servo(GRIPPER)
        what = f"held for {seconds:.0f} s"
        if self.tripped_after_s is not None:
            what = f"tripped after {self.tripped_after_s:.1f} s"
        load, heat = abs(servo["present_load"]) / 10, servo["present_temperature"]
        return f"{self.name:<26} {what}, load {load:.0f} %, {heat} °C"


def main(seconds: float) -> int:
    """Runs the cases; the exit code."""
    with ExitStack() as stack:
        cases = [
            Case(stack, "grip mode", {}),
            Case(stack, "without grip mode", {"grip_load_percent": 0}),
            Case(stack, "factory settings", {"gripper": False}),
        ]
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            next_s = time.monotonic() + PERIOD_S
            for case in cases:
                case.cycle()
            time.sleep(max(0.0, next_s - time.monotonic()))
        for case in cases:
            print(case.report(seconds))
        held, *baselines = cases
        return int(
            held.tripped_after_s is not None or any(case.tripped_after_s is None for case in baselines)
        )


if __name__ == "__main__":
    sys.exit(main(float(sys.argv[1]) if len(sys.argv) > 1 else SECONDS))

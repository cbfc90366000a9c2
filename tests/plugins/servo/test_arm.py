"""What every arm of servos does, whatever their protocol."""

from __future__ import annotations

import time

import numpy as np
from joshua_emulator import EmulatedBus
from servo_families import Kind


def test_a_joint_beyond_its_range_stays_until_it_is_told_and_comes_back_slowly(
    kind: Kind, arm_emulator: EmulatedBus
) -> None:
    calibration = arm_emulator.calibration()
    motor = calibration["motors"][1]
    start = motor["range_max"]
    motor["range_max"] -= 600
    arm_emulator.hand({2: start})
    arm = kind.driver(arm_emulator, calibration=calibration)
    arm.connect()
    try:
        arm.enable()
        here = arm.read().position_rad
        assert here[1] > arm.limits.position_max_rad[1] + 0.8
        for _ in range(5):
            np.testing.assert_allclose(arm.write(here), here, atol=0.001)
        began_s = time.monotonic()
        further = arm.write(here + 0.5)
        assert further[1] <= here[1] + 0.001, "no farther out"
        assert arm_emulator.servo(2)["goal_position"] == start
        back = arm.write(np.zeros(6))
        fastest = arm.limits.velocity_max_rad_s[1] * (time.monotonic() - began_s + 0.5)
        assert here[1] - back[1] <= fastest, "no faster than the joint may move"
        arm.hold()
    finally:
        arm.disconnect()

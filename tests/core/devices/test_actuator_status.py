"""What is said about readings that failed: the device is blamed only if it had the time to reply."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
import pytest
from joshua.devices.actuator import JointReading
from joshua.devices.actuator_status import ActuatorStatus
from joshua.devices.errors import DeviceSilent
from joshua.guardian.silence import Patience

LOG = logging.getLogger("status")


class Arm:
    """An arm in virtual time, whose driver may be delayed before each reading."""

    def __init__(self) -> None:
        self.now_s = 10.0
        self.delayed_s = 0.0
        self.silent = True
        self.status = ActuatorStatus(None)  # type: ignore[arg-type] # the spec is for rows only
        self.status._patience = Patience(clock=lambda: self.now_s, waited=lambda: self.delayed_s)

    def read(self) -> JointReading:
        self.now_s += 0.02
        if self.silent:
            raise DeviceSilent("no servo answers. Check the supply.")
        return JointReading(0, np.zeros(1), np.zeros(1), np.zeros(1))

    def cycle(self, delay_s: float = 0.0) -> Any:
        self.now_s += 0.02 + delay_s
        self.delayed_s += delay_s
        return self.status.read(self, LOG)  # type: ignore[arg-type]


def failure(arm: Arm, delay_s: float) -> str:
    with pytest.raises(DeviceSilent) as caught:  # noqa: PT012
        while True:
            arm.cycle(delay_s)
    return str(caught.value)


def test_a_silent_device_is_blamed() -> None:
    arm = Arm()
    assert failure(arm, 0.0) == "no servo answers. Check the supply."
    assert arm.now_s - 10.0 == pytest.approx(0.42, abs=0.03)


def test_a_delay_within_a_silence_is_told() -> None:
    arm = Arm()
    assert arm.cycle() is None
    assert arm.cycle(0.7) is None
    text = failure(arm, 0.0)
    assert text.startswith("no servo answers. Check the supply. (no reply for 1.")
    assert "of which this driver was delayed by 0.70 s" in text


def test_a_driver_that_is_delayed_all_the_time_blames_nobody() -> None:
    text = failure(Arm(), 0.3)
    assert "no servo answers" not in text
    assert "no reply for 2.06 s, of which this driver was delayed by 1.80 s" in text
    assert "too busy to tell whether the device is at fault. Close other programs" in text


def test_a_gap_that_ends_is_told_with_its_delay(caplog: pytest.LogCaptureFixture) -> None:
    arm = Arm()
    arm.cycle()
    arm.cycle(0.5)
    arm.silent = False
    assert arm.cycle() is not None
    assert "no reply for 0.60 s, of which this driver was delayed by 0.50 s: the cycles in" in caplog.text
    assert arm.status.missed == 2
    assert arm.status.longest_gap_s == pytest.approx(0.60)

"""Sources read the baud codes 5 to 7 in two ways: servos of either reading are found and set."""

from __future__ import annotations

from typing import Any, ClassVar

import pytest
from joshua_emulator.event_log import EventLog
from joshua_emulator.faults import Faults
from joshua_emulator.feetech.bus import FeetechBus
from joshua_emulator.feetech.servo import Servo
from joshua_emulator.joint import Joint
from joshua_emulator.servo_bus.servo import Supply
from joshua_servo import bus as servo_bus
from joshua_servo import servo_bus_tools
from joshua_sts3215.bus_tools import Sts3215BusTools
from joshua_sts3215.registers import BAUDRATES, OTHER_BAUDRATES
from stepped_time import SteppedTime
from virtual_line import Line


class OtherServo(Servo):
    """A servo of the other reading."""

    baudrates: ClassVar = {**BAUDRATES, **OTHER_BAUDRATES}


def rig(kind: type[Servo], monkeypatch: pytest.MonkeyPatch) -> tuple[Servo, Sts3215BusTools]:
    clock = SteppedTime()
    monkeypatch.setattr(servo_bus, "time", clock)
    monkeypatch.setattr(servo_bus_tools, "time", clock)
    servo = kind(Joint(2048.0), Supply())
    servo.put("return_delay", 0)
    port: Any = Line(FeetechBus([servo], EventLog(), Faults()), clock)
    return servo, Sts3215BusTools(port)


@pytest.mark.parametrize("kind", [Servo, OtherServo])
@pytest.mark.parametrize("code", [5, 6, 7])
def test_a_servo_of_either_reading_is_found(
    kind: type[Servo], code: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    servo, tools = rig(kind, monkeypatch)
    servo.put("baudrate", code)
    (motor,) = tools.scan()
    assert (motor.motor_id, motor.baudrate) == (1, servo.baudrate)


@pytest.mark.parametrize("kind", [Servo, OtherServo])
@pytest.mark.parametrize("baudrate", [57_600, 38_400])
def test_a_servo_of_either_reading_gets_the_speed_that_is_meant(
    kind: type[Servo], baudrate: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    servo, tools = rig(kind, monkeypatch)
    (motor,) = tools.scan([1_000_000])
    found = tools.assign(motor, 3, baudrate)
    assert (found.motor_id, found.baudrate) == (3, baudrate)
    assert servo.baudrate == baudrate

from __future__ import annotations

import pytest
from joshua_servo.bus_tools import AssignmentFailed
from servo_families import Kind


def test_two_servos_of_one_id_are_told_apart_from_one(kind: Kind) -> None:
    with kind.emulated_bus((1,)) as emulator, kind.open_tools(emulator) as tools:
        emulator.fault("duplicate", 1)
        (motor,) = tools.scan((1_000_000,))
        assert (motor.shared, motor.model) == (True, "")
        assert str(motor) == "1 (several motors)"
        with pytest.raises(AssignmentFailed, match=r"several motors answer to id 1.*Connect one alone"):
            tools.assign(motor, 2, 1_000_000)


def test_a_servo_that_vanishes_for_good_is_reported_so(kind: Kind) -> None:
    with kind.emulated_bus((1,)) as emulator, kind.open_tools(emulator) as tools:
        motor = next(tools.scan((1_000_000,)))
        emulator.fault("silent")
        with pytest.raises(AssignmentFailed, match=r"It no longer answers\. Check its cable"):
            tools.assign(motor, 4, 1_000_000)

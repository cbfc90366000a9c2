import re

import numpy as np
import pytest
from joshua.devices.diagnostics import DiagnosticStatus
from joshua_servo.counters import BusCounters
from joshua_servo.diagnostics import bus_row, joint_rows
from joshua_servo.feedback import Feedback
from joshua_servo.watch import HealthLimits, HealthWatch
from joshua_sts3215.feedback import parse_feedback
from joshua_sts3215.registers import STATUS_BITS, StatusBit

GOOD = Feedback(2048, 0, 0.1, 12.0, 30, 0, False, 0.2)


def watch() -> HealthWatch:
    return HealthWatch(["pan", "lift"], [HealthLimits(70, 9.0, 14.0)] * 2, STATUS_BITS)


def test_feedback_is_read_with_its_signs() -> None:
    data = bytes((0x00, 0x08, 0x0A, 0x80, 0xF4, 0x05, 121, 33, 0, 0x20, 1, 0, 0, 100, 0))
    feedback = parse_feedback(data)
    assert feedback == Feedback(2048, -10, -0.5, 12.1, 33, 0x20, True, pytest.approx(0.65))  # type: ignore[arg-type]
    against = parse_feedback(data[:13] + bytes((100, 0x80)))
    assert against.current_a == pytest.approx(0.65), "the highest bit is the direction"


def test_a_healthy_arm_does_not_trip() -> None:
    assert watch().trip_reason([GOOD, GOOD]) == ""


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (
            {"status": StatusBit.OVERLOAD, "load": 0.9},
            r"lift: the servo reports: overloaded \(load \+90%, 30 °C, 12.0 V\)",
        ),
        ({"status": StatusBit.TEMPERATURE}, "lift: the servo reports: too hot"),
        ({"temperature_c": 71}, "lift: 71 °C, at most 70 °C"),
    ],
)
def test_overload_and_heat_trip_at_once(change: dict[str, object], reason: str) -> None:
    assert re.match(reason, watch().trip_reason([GOOD, GOOD._replace(**change)]))  # type: ignore[arg-type]


def test_a_voltage_must_be_wrong_for_a_while() -> None:
    guard, low = watch(), GOOD._replace(voltage_v=8.0, status=StatusBit.VOLTAGE)
    assert [guard.trip_reason([low, GOOD]) for _ in range(2)] == ["", ""]
    assert guard.trip_reason([GOOD, GOOD]) == ""
    assert [guard.trip_reason([low, GOOD]) for _ in range(2)] == ["", ""]
    assert guard.trip_reason([low, GOOD]) == "pan: 8.0 V, allowed 9.0 to 14.0 V"


def test_rows_tell_levels_and_values() -> None:
    hot, overloaded = GOOD._replace(temperature_c=65), GOOD._replace(status=StatusBit.OVERLOAD)
    motion = (np.array([0.5, -0.25]), np.array([0.0, 1.5]))
    rows = joint_rows(["pan", "lift"], [1, 2], [hot, overloaded], motion, watch(), "usb:SN1")
    assert [row.level for row in rows] == [DiagnosticStatus.WARN, DiagnosticStatus.ERROR]
    assert [row.message for row in rows] == ["65 °C, close to its limit of 70 °C", "overloaded"]
    assert rows[1].hardware_id == "usb:SN1 id 2"
    assert rows[0].values["temperature_c"] == "65"
    assert [row.values["position_rad"] for row in rows] == ["0.5000", "-0.2500"]
    assert rows[1].values["velocity_rad_s"] == "1.500"
    assert joint_rows(["pan"], [1], [GOOD], motion, watch(), "")[0].level == DiagnosticStatus.OK


def test_the_bus_row_counts_what_was_lost_since_the_last() -> None:
    counters = BusCounters(requests=10, lost={3: 2, 1: 1})
    row = bus_row(counters, 1, "usb:SN1")
    assert (row.level, row.message) == (
        DiagnosticStatus.WARN, "2 replies lost since the last report, mostly from id 3: check its cable",
    )  # fmt: skip
    assert bus_row(counters, 3, "").level == DiagnosticStatus.OK
    assert row.values["lost_replies"] == "3"

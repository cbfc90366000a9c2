"""Recording of a test's motion: lag, load, temperature, and bounds on memory."""

from __future__ import annotations

import numpy as np
import pytest
from joshua.devices.actuator import JointReading
from joshua.devices.actuator_test import MOST_SAMPLES, MOST_VALUES, MotionRecorder
from joshua.devices.diagnostics import DiagnosticStatus

PERIOD_S = 0.02


def record(lag_s: float, cycles: int = 400, amplitude: float = 0.5) -> MotionRecorder:
    """A joint that follows a sine with a lag, beside one that rests."""
    recorder = MotionRecorder()
    for cycle in range(cycles):
        time_s = cycle * PERIOD_S
        position = np.array([amplitude * np.sin(time_s - lag_s), 1.0])
        stamp_ns = round(time_s * 1e9) + 1_000_000
        recorder.state(JointReading(stamp_ns, position, np.zeros(2), np.array([-0.25, 0.1])))
        recorder.written(np.array([amplitude * np.sin(time_s), 1.0]))
    return recorder


@pytest.mark.parametrize("lag_s", [0.0, 0.05, 0.13, 0.5])
def test_the_lag_is_that_of_the_motion(lag_s: float) -> None:
    assert record(lag_s).lag_s() == pytest.approx(lag_s, abs=0.003)


def test_a_joint_that_rests_has_no_lag() -> None:
    assert record(0.1, amplitude=0.001).lag_s() is None
    assert record(0.1, cycles=3).lag_s() is None
    assert MotionRecorder().lag_s() is None


def test_only_cycles_that_follow_each_other_count_for_the_lag() -> None:
    recorder = record(0.1)
    recorder._goals[200] = None
    assert recorder.lag_s() == pytest.approx(0.1, abs=0.003)


def test_load_and_temperature_are_rows_of_the_table() -> None:
    recorder = record(0.05)
    assert ("load", True, "0.25 at most") in recorder.results()
    for celsius in (27, 31):
        row = DiagnosticStatus(
            DiagnosticStatus.OK, "pan", "in order", "x", {"temperature_c": str(celsius), "load": "+0.1"}
        )
        recorder.diagnosed([row])
    assert recorder.results() == [
        ("lag", True, "50 ms behind the goal"),
        ("load", True, "25% of stall torque at most"),
        ("temperature", True, "27 to 31 °C"),
    ]
    (pan, tilt) = recorder.traces(["pan", "tilt"])
    assert [value for _, value in pan.temperature_c] == [27.0, 31.0]
    assert tilt.temperature_c == ()
    assert (pan.joint, len(pan.time_s), pan.time_s[1]) == ("pan", 400, 0.02)
    assert tilt.position_rad[0] == 1.0


def test_what_nobody_commands_has_neither_lag_nor_load() -> None:
    recorder = MotionRecorder()
    recorder.state(JointReading(1, np.zeros(1), np.zeros(1), np.zeros(1)))
    assert recorder.results() == []
    assert recorder.traces(["a"])[0].goal_rad == (None,)
    assert MotionRecorder().traces(["a"]) == []


def test_a_long_test_stays_small() -> None:
    recorder = record(0.1, cycles=3 * MOST_SAMPLES)
    (first, _) = recorder.traces(["a", "b"])
    assert len(first.time_s) <= MOST_SAMPLES
    assert first.time_s[-1] == pytest.approx(3 * MOST_SAMPLES * PERIOD_S, abs=0.2)
    assert recorder.lag_s() == pytest.approx(0.1, abs=0.01)
    many = MotionRecorder()
    for cycle in range(MOST_SAMPLES):
        many.state(JointReading(cycle + 1, np.zeros(40), np.zeros(40), np.zeros(40)))
    traces = many.traces([f"j{index}" for index in range(40)])
    assert sum(4 * len(trace.time_s) for trace in traces) <= MOST_VALUES

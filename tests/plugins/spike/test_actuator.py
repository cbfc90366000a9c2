"""The driver on an emulated hub with the shipped program: motion, dead man's switch, uploads, battery."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pytest
from joshua.devices.diagnostics import DiagnosticStatus
from joshua.messages import decode, encode
from joshua_emulator.spike.process import EmulatedHub
from joshua_spike import client, session
from joshua_spike.actuator import SpikeActuator
from joshua_spike.diagnostics import BATTERY_STATE
from joshua_spike.errors import LinkLost, NotCalibrated, NotEnabled, SafetyTripped

#: Of the hub's dead man's switch in the tests of it; in the others a busy machine must not trip it.
DEAD_MAN_S = 1.0

MakeActuator = Callable[..., SpikeActuator]


def wait_until(reached: Callable[[], bool], timeout_s: float = 60.0) -> None:
    end_s = time.monotonic() + timeout_s
    while not reached():
        assert time.monotonic() < end_s, "it did not come about"
        time.sleep(0.01)


def drive(actuator: SpikeActuator, goal: np.ndarray, timeout_s: float = 60.0) -> None:
    """Commands a goal until it is reached."""
    end_s = time.monotonic() + timeout_s
    while np.abs(actuator.read().position_rad - goal).max() > 0.02:
        actuator.write(goal)
        assert time.monotonic() < end_s, "the goal was not reached"


def read_on(actuator: SpikeActuator) -> None:
    """Reads for a while, as a node does."""
    end_s = time.monotonic() + 60
    while time.monotonic() < end_s:
        actuator.read()


def powered(hub: EmulatedHub) -> list[bool]:
    return [motor["powered"] for motor in hub.state()["motors"].values()]


def test_joints_go_where_they_are_commanded_in_radians(hub: EmulatedHub, make_actuator: MakeActuator) -> None:
    actuator = make_actuator()
    actuator.connect()
    assert actuator.read().position_rad == pytest.approx(np.radians([12, -25]))
    assert powered(hub) == [False, False]
    actuator.enable()
    drive(actuator, np.radians([40.0, -60.0]))
    angles = [motor["absolute_deg"] for motor in hub.state()["motors"].values()]
    assert angles == pytest.approx([40, -60], abs=1.5)
    actuator.release()
    assert powered(hub) == [False, False]


def test_effort_and_speed_have_the_signs_of_the_joint(hub: EmulatedHub, make_actuator: MakeActuator) -> None:
    motor = {"id": 1, "joint_name": "lift", "range_min": 0, "range_max": 4095, "inverted": True}
    actuator = make_actuator(port_names=["A"], calibration={"motors": [motor]})
    actuator.connect()
    start = actuator.read().position_rad
    actuator.enable()
    up, fastest, end_s = start + 0.15, 0.0, time.monotonic() + 60
    while fastest < 0.5:  # again, where no state was seen on the way
        assert time.monotonic() < end_s, "it does not move"
        drive(actuator, start - 1.0)
        while np.abs((reading := actuator.read()).position_rad - up).max() > 0.02:
            actuator.write(up)
            fastest = max(fastest, float(reading.velocity_rad_s[0]))
    assert hub.motor("A")["absolute_deg"] < 12


def test_a_joint_beyond_its_range_stays_until_it_is_told(
    hub: EmulatedHub, make_actuator: MakeActuator
) -> None:
    # zero is at the motor's mark, and the range ends at -4 degrees
    motor = {"id": 1, "joint_name": "lift", "homing_offset": -2047, "range_min": 1000, "range_max": 2000}
    actuator = make_actuator(port_names=["A"], calibration={"motors": [motor]})
    actuator.connect()
    actuator.enable()
    here = actuator.read().position_rad
    assert here == pytest.approx(np.radians([12]), abs=0.002)
    for goal in (here, here + 0.5):
        assert actuator.write(goal) == pytest.approx(here)
        actuator.read()
    drive(actuator, actuator.limits.position_max_rad)
    assert actuator.write(here) == pytest.approx(actuator.limits.position_max_rad, abs=np.radians(1))
    assert {entry["angle_deg"] for entry in hub.log("track")} <= set(range(-5, 13))


@pytest.mark.parametrize(("safe_state", "holds"), [("HOLD", True), ("RELEASE", False)])
def test_the_hub_stops_its_motors_when_nothing_comes(
    hub: EmulatedHub,
    make_actuator: MakeActuator,
    monkeypatch: pytest.MonkeyPatch,
    safe_state: str,
    holds: bool,
) -> None:
    monkeypatch.setattr(client, "DEAD_MAN_S", DEAD_MAN_S)
    actuator = make_actuator({"allow_uncalibrated": True, "safe_state": safe_state})
    actuator.connect()
    actuator.enable()
    far = actuator.read().position_rad + 2.5
    actuator.write(far)
    hub.fault("out_of_range")
    time.sleep(DEAD_MAN_S + 0.1)
    wait_until(lambda: powered(hub) == [holds, holds] and hub.motor("A")["speed_deg_s"] == 0)
    with pytest.raises(LinkLost, match="out of range"):
        read_on(actuator)


def test_a_caller_that_hangs_stops_the_motors_though_the_link_stands(
    hub: EmulatedHub, make_actuator: MakeActuator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(client, "DEAD_MAN_S", DEAD_MAN_S)
    actuator = make_actuator({"allow_uncalibrated": True, "safe_state": "RELEASE"})
    actuator.connect()
    actuator.enable()
    here = actuator.write(actuator.read().position_rad)
    wait_until(lambda: powered(hub) == [False, False])
    with pytest.raises(SafetyTripped, match=r"the hub stopped the motors, because.*move closer"):
        read_on(actuator)  # the first state may be an older one
    actuator.read()  # it goes on to say where the joints are
    with pytest.raises(SafetyTripped):
        actuator.write(here)
    actuator.enable()
    actuator.write(here)
    assert powered(hub) == [True, True]


def test_held_motors_stay_held_without_a_link(
    hub: EmulatedHub, make_actuator: MakeActuator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(client, "DEAD_MAN_S", DEAD_MAN_S)
    actuator = make_actuator()
    actuator.connect()
    actuator.enable()
    actuator.hold()
    actuator.disconnect()
    time.sleep(2 * DEAD_MAN_S)
    assert powered(hub) == [True, True]


def test_nothing_is_energised_without_calibration_or_before_enable(
    hub: EmulatedHub, make_actuator: MakeActuator
) -> None:
    actuator = make_actuator({})
    actuator.connect()
    with pytest.raises(NotCalibrated, match="--allow-uncalibrated"):
        actuator.enable()
    with pytest.raises(NotEnabled, match="call enable first"):
        actuator.write(actuator.read().position_rad)
    assert powered(hub) == [False, False]


def test_a_dry_run_commands_nothing(hub: EmulatedHub, make_actuator: MakeActuator) -> None:
    actuator = make_actuator({"allow_uncalibrated": True, "dry_run": True})
    actuator.connect()
    actuator.enable()
    actuator.write(actuator.read().position_rad + 0.1)
    actuator.hold()
    assert powered(hub) == [False, False]
    assert hub.log("track") == []


def test_the_program_is_uploaded_once_and_again_only_where_another_runs(
    hub: EmulatedHub, make_actuator: MakeActuator, monkeypatch: pytest.MonkeyPatch
) -> None:
    actuator = make_actuator()
    for uploads in (1, 1):
        actuator.connect()
        actuator.read()
        actuator.disconnect()
        assert len(hub.log("upload")) == uploads
    hub.fault("button")
    hub.fault("other_program")  # somebody's own program runs now, and prints in the middle of lines
    wait_until(lambda: hub.state()["running"])
    monkeypatch.setattr(session, "HELLO_PATIENCE_S", 1.2)  # nobody answers
    actuator.connect()
    actuator.read()
    assert [entry["holes"] for entry in hub.log("upload")] == [0, 0]


def test_turns_are_kept_over_a_lost_link(hub: EmulatedHub, make_actuator: MakeActuator) -> None:
    actuator = make_actuator()
    actuator.connect()
    actuator.enable()
    drive(actuator, np.radians([100.0, -100.0]))
    actuator.hold()
    hub.fault("out_of_range")
    wait_until(lambda: not hub.state()["connected"])
    with pytest.raises(LinkLost):
        drive(actuator, np.radians([120.0, -100.0]))
    actuator.disconnect()
    hub.fault("in_range")
    actuator.connect()
    assert actuator.read().position_rad == pytest.approx(np.radians([100, -100]), abs=0.03)
    assert len(hub.log("upload")) == 1


def test_broken_lines_are_dropped_and_counted(hub: EmulatedHub, make_actuator: MakeActuator) -> None:
    actuator = make_actuator()
    actuator.connect()
    hub.fault("corrupt", 0.02)
    positions = np.array([actuator.read().position_rad for _ in range(150)])
    assert np.ptp(positions, axis=0) == pytest.approx([0, 0])
    assert actuator.counters.corrupt > 0


def test_the_newest_set_point_wins_on_a_slow_link(hub: EmulatedHub, make_actuator: MakeActuator) -> None:
    actuator = make_actuator()
    actuator.connect()
    actuator.enable()
    start = actuator.read().position_rad
    hub.fault("slow", 0.05)
    began_s = time.monotonic()
    for step in range(100):  # hundreds a second, of which the link carries two dozen
        actuator.write(start + 0.01 * step)
        time.sleep(0.002)
    target = actuator.write(start + 1.0)

    def tracked() -> list[int]:
        return [entry["angle_deg"] for entry in hub.log("track") if entry["port"] == "A"]

    wait_until(lambda: tracked()[-1:] == [round(np.degrees(target[0]))])
    assert len(tracked()) < 20 + 30 * (time.monotonic() - began_s)
    assert tracked() == sorted(tracked())


def test_a_blocked_motor_shows_its_load_and_stays(hub: EmulatedHub, make_actuator: MakeActuator) -> None:
    actuator = make_actuator()
    actuator.connect()
    actuator.enable()
    start = actuator.read()
    hub.fault("stall", "A")  # type: ignore[arg-type]
    end_s = time.monotonic() + 60
    reading = start
    while reading.position_rad[1] < start.position_rad[1] + 0.9 or reading.effort[0] < 0.179:
        assert time.monotonic() < end_s, reading
        actuator.write(start.position_rad + 1.0)
        reading = actuator.read()
        time.sleep(0.02)
    assert reading.position_rad[0] == pytest.approx(start.position_rad[0], abs=0.05)
    assert reading.effort[0] == pytest.approx(0.18)  # N·m, its stall torque


def test_the_battery_and_the_link_are_in_the_diagnostics(
    hub: EmulatedHub, make_actuator: MakeActuator
) -> None:
    actuator = make_actuator()
    assert actuator.diagnostics() == ()
    assert actuator.further_message(BATTERY_STATE, "hub") is None
    actuator.connect()
    actuator.read()
    rows: dict[str, DiagnosticStatus] = {}

    def look() -> bool:
        """Whether all is well; a line that came late on a busy machine is one that was lost."""
        rows.update({row.name: row for row in actuator.diagnostics()})
        return {row.level for row in rows.values()} == {DiagnosticStatus.OK}

    wait_until(look)
    assert set(rows) == {"joint_a", "joint_b", "battery", "link"}
    assert rows["battery"].values["voltage_v"] == "8.10"
    assert rows["joint_b"].hardware_id == f"{actuator.identity} port B"
    hub.fault("battery", 6500)
    wait_until(lambda: actuator.read() is not None and "6.50" in str(actuator.diagnostics()))
    low = next(row for row in actuator.diagnostics() if row.name == "battery")
    assert (low.level, low.message) == (DiagnosticStatus.WARN, "low: charge the hub soon")
    message = actuator.further_message(BATTERY_STATE, "hub")
    assert message.__msgtype__ == BATTERY_STATE
    assert (message.voltage, message.percentage, message.present) == (6.5, 0.0, True)
    assert message.serial_number == actuator.identity
    assert np.isnan([message.current, message.temperature, message.charge, message.capacity]).all()
    assert message.header.frame_id == "hub"
    assert decode(BATTERY_STATE, encode(message)).voltage == pytest.approx(6.5)


def test_two_hubs_are_driven_side_by_side(hub: EmulatedHub, make_actuator: MakeActuator) -> None:
    with EmulatedHub(("C",), name="Second Hub") as other:
        first = make_actuator()
        second = make_actuator(device_name="Second Hub", adapter=other.adapter, port_names=["C"])
        for actuator in (first, second):
            actuator.connect()
        assert (first.identity, second.identity) == (f"ble:{hub.address}", f"ble:{other.address}")
        assert first.identity != second.identity
        second.enable()
        drive(second, np.radians([70.0]))
        with pytest.raises(NotEnabled):
            first.write(first.read().position_rad)
        first.enable()
        drive(first, np.radians([-20.0, 0.0]))
        assert other.motor("C")["absolute_deg"] == pytest.approx(70, abs=1.5)
        assert hub.motor("A")["absolute_deg"] == pytest.approx(-20, abs=1.5)

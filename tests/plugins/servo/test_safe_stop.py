import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from joshua.guardian.safe_stop import perform
from joshua_emulator import EmulatedBus
from joshua_serial.port import SerialPort
from joshua_servo import safe_stop
from joshua_servo.safe_stop import ServoStopRequest
from joshua_sts3215.safe_stop import Sts3215StopRequest
from servo_families import STS3215_KIND, Kind

SYNC_WRITE = 0x83  # the instruction, in the protocols of both families
SUPPORT = Path(__file__).parents[2] / "support"
DRIVER = """
import contextlib, sys, json, numpy as np
from joshua.devices.errors import DeviceSilent
from servo_families import KINDS
(kind,) = [kind for kind in KINDS if kind.protocol == sys.argv[2]]
arm = kind.actuator(kind.settings_type.model_validate_json(sys.argv[1]))
arm.connect()
arm.enable()
print("driving", flush=True)
goal = arm.read().position_rad
while True:
    goal = np.clip(goal + 0.002, arm.limits.position_min_rad, arm.limits.position_max_rad)
    with contextlib.suppress(DeviceSilent):  # on a busy machine
        arm.read()
    arm.write(goal)
"""


def request_for(emulator: EmulatedBus, action: str, **values: Any) -> ServoStopRequest:
    return ServoStopRequest(
        action,
        (1, 2, 3, 4, 5, 6),
        path=emulator.port,
        device_root=str(emulator.root),
        **{"timeout_s": 40.0, **values},
    )


@contextmanager
def driver_on(kind: Kind, emulator: EmulatedBus) -> Iterator[subprocess.Popen[str]]:
    """A driver process that moves the arm without end."""
    process = subprocess.Popen(
        [sys.executable, "-c", DRIVER, json.dumps(kind.settings_of(emulator)), kind.protocol],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(SUPPORT)},
    )
    assert process.stdout is not None
    try:
        assert process.stdout.readline() == "driving\n"
        yield process
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


def energised(emulator: EmulatedBus) -> set[bool]:
    return {servo["energised"] for servo in emulator.servos()}


@pytest.fixture
def moving_arm(kind: Kind, arm_emulator: EmulatedBus) -> EmulatedBus:
    """An arm with torque on that moves towards far goals, and no driver any more."""
    arm = kind.driver(arm_emulator, **kind.slow)
    arm.connect()
    arm.enable()
    for _ in range(20):
        arm.write(np.full(6, 0.5))
    arm.disconnect()
    return arm_emulator


GRIP_DRIVER = """
import contextlib, sys, json
from joshua.devices.errors import DeviceSilent
from servo_families import STS3215_KIND as kind
arm = kind.actuator(kind.settings_type.model_validate_json(sys.argv[1]))
arm.connect()
arm.enable()
print(json.dumps(arm.safe_stop_request("HOLD", timeout_s=40.0).to_values()), flush=True)
goal = arm.read().position_rad
goal[5] = max(goal[5] - 0.6, arm.limits.position_min_rad[5])
while True:
    with contextlib.suppress(DeviceSilent):  # on a busy machine
        arm.read()
    arm.write(goal)
"""


@pytest.mark.timing
def test_hold_keeps_the_grip_of_a_driver_that_was_killed() -> None:
    with STS3215_KIND.emulated_arm() as emulator:
        emulator.ask("set", id=6, object_ticks=emulator.servo(6)["present_position"] - 50)
        process = subprocess.Popen(
            [sys.executable, "-c", GRIP_DRIVER, json.dumps(STS3215_KIND.settings_of(emulator))],
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": str(SUPPORT)},
        )
        assert process.stdout is not None
        try:
            request = json.loads(process.stdout.readline())
            deadline_s = time.monotonic() + 60
            while emulator.ask("registers", id=6)["registers"]["torque_limit"] != 200:  # it grips
                assert time.monotonic() < deadline_s
                time.sleep(0.05)
        finally:
            process.kill()
            process.wait()
            process.stdout.close()

        report = perform(Sts3215StopRequest, request)

        assert report["complete"]
        assert set(report["joints"].values()) == {"held"}
        time.sleep(2.5)  # a gripper that presses on trips within 2.2 s
        servo = emulator.servo(6)
        assert servo["energised"]
        assert 0 < servo["present_position"] - servo["goal_position"] <= 33
        assert 150 <= abs(servo["present_load"]) <= 200
        for servo in emulator.servos()[:5]:
            assert abs(servo["present_position"] - servo["goal_position"]) <= 2


def test_release_takes_the_torque_off_and_reads_it_back(kind: Kind, moving_arm: EmulatedBus) -> None:
    report = kind.stop(request_for(moving_arm, "RELEASE"))
    assert report.complete
    assert set(report.joints.values()) == {"released"}
    assert report.detail == ""
    assert energised(moving_arm) == {False}


def test_hold_stops_where_the_arm_is(kind: Kind, moving_arm: EmulatedBus) -> None:
    report = kind.stop(request_for(moving_arm, "HOLD"))
    assert set(report.joints.values()) == {"held"}
    assert energised(moving_arm) == {True}
    goals = [servo["goal_position"] for servo in moving_arm.servos()]
    deadline_s = time.monotonic() + 40
    while [servo["present_position"] for servo in moving_arm.servos()] != goals:
        assert time.monotonic() < deadline_s


def test_hold_does_not_energise_what_is_off(kind: Kind, arm_emulator: EmulatedBus) -> None:
    report = kind.stop(request_for(arm_emulator, "HOLD"))
    assert report.complete
    assert set(report.joints.values()) == {"was off"}
    assert energised(arm_emulator) == {False}


@pytest.mark.parametrize("echo", [False, True])
def test_a_known_echo_is_not_looked_for(kind: Kind, echo: bool) -> None:
    with kind.emulated_bus((1, 2, 3, 4, 5, 6), echo=echo) as emulator:
        for known, probes in ((None, 1), (echo, 0)):
            sequence = emulator.log()[-1]["sequence"] if emulator.log() else 0
            report = kind.stop(request_for(emulator, "HOLD", echo=known))
            assert set(report.joints.values()) == {"was off"}
            assert len(emulator.log("sync_write", since=sequence)) == probes


def test_park_goes_to_the_pose_and_lets_go(kind: Kind, moving_arm: EmulatedBus) -> None:
    pose = dict.fromkeys(range(1, 7), 2100)
    report = kind.stop(request_for(moving_arm, "PARK_THEN_RELEASE", park_ticks=pose))
    assert set(report.joints.values()) == {"released"}
    assert report.detail == ""
    assert energised(moving_arm) == {False}
    assert all(abs(servo["present_position"] - 2100) <= 60 for servo in moving_arm.servos())


@pytest.fixture
def long_reserve_s(monkeypatch: pytest.MonkeyPatch) -> float:
    """Of the time for parking, a busy machine gets so much for letting go."""
    monkeypatch.setattr(safe_stop, "RELEASE_RESERVE_S", 20.0)
    return 20.0


def test_parking_that_takes_too_long_ends_in_a_release(
    kind: Kind, moving_arm: EmulatedBus, long_reserve_s: float
) -> None:
    moving_arm.ask("set", id=2, blocked=True)
    timeout_s = long_reserve_s + 0.4
    request = request_for(moving_arm, "PARK_THEN_RELEASE", park_ticks={2: 1500}, timeout_s=timeout_s)
    report = kind.stop(request)
    assert report.complete
    assert report.detail == "released before ids 2 reached the park pose"
    assert energised(moving_arm) == {False}


def test_a_silent_servo_is_reported_honestly(kind: Kind, moving_arm: EmulatedBus) -> None:
    moving_arm.fault("silent", 5)
    report = kind.stop(request_for(moving_arm, "RELEASE", timeout_s=1.5))
    assert not report.complete
    assert report.joints[5] == "not verified"
    assert report.joints[1] == "released"
    assert report.detail == "ids 5 did not confirm. Cut the arm's supply by hand if it still holds"


def test_lost_packets_do_not_stop_it(kind: Kind, moving_arm: EmulatedBus) -> None:
    for fault in ("drop", "drop_request", "corrupt"):
        moving_arm.fault(fault, 0.2)
    report = kind.stop(request_for(moving_arm, "RELEASE"))
    assert report.complete
    moving_arm.ask("clear_faults")
    assert energised(moving_arm) == {False}


def test_an_absent_port_is_reported_in_time(kind: Kind, moving_arm: EmulatedBus) -> None:
    moving_arm.fault("unplug")
    moving_arm.wait_for(["unplug"])
    report = kind.stop(request_for(moving_arm, "RELEASE", timeout_s=0.2))
    assert not report.complete
    assert "no such serial port" in report.detail


def test_an_adapter_that_comes_back_is_waited_for(kind: Kind, moving_arm: EmulatedBus) -> None:
    moving_arm.fault("unplug", replug_after_s=0.2, name="ttyACM7")
    request = ServoStopRequest(
        "RELEASE", (1, 2, 3, 4, 5, 6), serial_number="ARM1", device_root=str(moving_arm.root), timeout_s=40.0
    )
    assert kind.stop(request).complete
    assert energised(moving_arm) == {False}


def test_a_port_that_cannot_be_opened_yet_is_waited_for(
    kind: Kind, moving_arm: EmulatedBus, tmp_path: Path
) -> None:
    """As of an adapter that is back and whose rights the system has not set yet."""
    port = tmp_path / "ttyACM0"
    port.touch()
    request = ServoStopRequest("RELEASE", (1, 2, 3, 4, 5, 6), path=str(port), timeout_s=40.0)

    def settle() -> None:
        port.unlink()
        port.symlink_to(moving_arm.port)

    timer = threading.Timer(0.1, settle)
    timer.start()
    assert kind.stop(request).complete
    timer.join()
    assert energised(moving_arm) == {False}


def test_an_adapter_that_goes_away_meanwhile_is_waited_for(
    kind: Kind, moving_arm: EmulatedBus, long_reserve_s: float
) -> None:
    moving_arm.ask("set", id=2, blocked=True)
    moving_arm.fault("unplug", at_s=0.3, replug_after_s=0.2, name="ttyACM7")
    request = ServoStopRequest(
        "PARK_THEN_RELEASE",
        (1, 2, 3, 4, 5, 6),
        serial_number="ARM1",
        device_root=str(moving_arm.root),
        park_ticks={2: 1500},
        timeout_s=long_reserve_s + 1.3,
    )
    report = kind.stop(request)
    assert [entry["event"] for entry in moving_arm.log("unplug", "plug")][-2:] == ["unplug", "plug"]
    assert report.complete, report
    assert energised(moving_arm) == {False}


def test_a_killed_driver_leaves_a_moving_arm_that_is_then_released(
    kind: Kind, arm_emulator: EmulatedBus
) -> None:
    with driver_on(kind, arm_emulator) as driver:
        assert energised(arm_emulator) == {True}
        driver.send_signal(signal.SIGKILL)
        report = kind.stop(request_for(arm_emulator, "RELEASE"))
    assert report.complete
    assert energised(arm_emulator) == {False}


def test_a_stopped_driver_holds_the_port_until_it_is_killed(kind: Kind, arm_emulator: EmulatedBus) -> None:
    with driver_on(kind, arm_emulator) as driver:
        driver.send_signal(signal.SIGSTOP)
        report = kind.stop(request_for(arm_emulator, "RELEASE", timeout_s=0.2))
        assert not report.complete
        assert f"(process {driver.pid})" in report.detail
        driver.send_signal(signal.SIGKILL)
        assert kind.stop(request_for(arm_emulator, "RELEASE")).complete
    assert energised(arm_emulator) == {False}


def test_a_request_survives_json(kind: Kind, moving_arm: EmulatedBus) -> None:
    request = request_for(moving_arm, "RELEASE", park_ticks={1: 5})
    assert ServoStopRequest.from_values(request.to_values()) == request
    report = perform(kind.stop_request, request.to_values())
    assert report["complete"] is True
    assert report["joints"]["1"] == "released"


def test_the_driver_prepares_the_request(kind: Kind, arm_emulator: EmulatedBus) -> None:
    arm = kind.driver(arm_emulator)
    assert arm.safe_stop_request("HOLD").echo is None
    arm.connect()
    request = arm.safe_stop_request("PARK_THEN_RELEASE", park_pose_rad=[0.0] * 6)
    assert request.echo is False
    assert request.park_ticks == dict.fromkeys(range(1, 7), 2048)
    assert request.serial_number == "ARM1"
    with pytest.raises(
        ValueError, match="unknown safe-stop action 'STOP'; allowed: HOLD, RELEASE, PARK_THEN_RELEASE"
    ):
        arm.safe_stop_request("STOP")
    arm.disconnect()
    assert kind.stop(request).complete


def test_it_imports_nothing_heavy(kind: Kind) -> None:
    program = (
        f"import sys, {kind.package}.safe_stop\n"
        "print(sorted({'numpy', 'pydantic', 'google.protobuf', 'zenoh', 'rich'} & set(sys.modules)))\n"
    )
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert result.stdout == "[]\n"


@pytest.mark.parametrize("cut", [1, 2, 3, 4, 5, 6, 7, 10, 16])
def test_half_a_packet_of_a_killed_driver_does_not_swallow_the_release(
    kind: Kind, moving_arm: EmulatedBus, cut: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What comes first is understood, and not only what is sent again after a time-out."""
    instruction = {"feetech": 4, "dynamixel": 7}[kind.protocol]  # its place in a packet
    written: list[bytes] = []
    with kind.open_bus(moving_arm) as bus:
        sent: list[bytes] = []
        send = bus.port.send
        bus.port.send = sent.append  # type: ignore[method-assign, assignment]
        goal = kind.family.goal_position
        bus.sync_write(goal.address, goal.width, dict.fromkeys((1, 2, 3, 4, 5, 6), goal.encode(2048)))
        send(sent[0][:cut])
    before = moving_arm.log()[-1]["sequence"]

    def send_and_note(port: SerialPort, data: bytes) -> None:
        written.extend([data] if data[instruction] == SYNC_WRITE else [])
        send_of_port(port, data)

    send_of_port = SerialPort.send
    monkeypatch.setattr(SerialPort, "send", send_and_note)
    report = kind.stop(request_for(moving_arm, "RELEASE"))
    assert report.complete, report
    assert energised(moving_arm) == {False}
    understood = [entry["event"] for entry in moving_arm.log(since=before)]
    # The release, a look for an echo, the release once more; further ones where replies are late.
    assert len(written) >= 3
    assert understood.count("sync_write") == len(written), understood

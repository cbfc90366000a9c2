"""What can be wrong with an arm before and during teleoperation: what the user reads, and who has torque."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from emulated_teleop import JOSHUA, teleoperation
from joshua_emulator import EmulatedBus
from joshua_serial.port import SerialPort
from joshua_serial.usb_ports import Endpoint
from watched import Watched

FOLLOWER = "robot.actions[follower_arm].sts3215_config"
POSE = [2300, 1900, 2200, 2000, 2150, 2100]


@pytest.fixture
def leader() -> Iterator[EmulatedBus]:
    with EmulatedBus(arm="so_arm100", calibrated=True, identity="LEADER") as arm:
        yield arm


@pytest.fixture
def follower() -> Iterator[EmulatedBus]:
    with EmulatedBus(arm="so_arm100", calibrated=True, identity="FOLLOWER") as arm:
        yield arm


def energised(arm: EmulatedBus) -> set[bool]:
    return {servo["energised"] for servo in arm.servos()}


def wait_until(condition: Callable[[], bool], timeout_s: float = 60.0) -> None:
    deadline_s = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < deadline_s
        time.sleep(0.05)


def refused(leader: EmulatedBus, follower: EmulatedBus, folder: Path, domain_id: int, *overrides: str) -> str:
    """Starts teleoperation, which must end before anything gets torque; returns what the user reads."""
    with teleoperation(leader, follower, folder, domain_id, overrides=overrides) as process:
        code, output = Watched(process).end()
    assert code == 4, output
    assert "Traceback" not in output
    for arm in (leader, follower):
        assert True not in energised(arm)
        assert not any(entry["on"] for entry in arm.log("torque"))
    return " ".join(output.split())


def test_a_wrong_port_is_named_with_the_ports_that_there_are(
    leader: EmulatedBus, follower: EmulatedBus, tmp_path: Path, joshua_domain_id: int
) -> None:
    wrong = f"{FOLLOWER}.comm.serial.port=/dev/ttyACM77"
    text = refused(leader, follower, tmp_path, joshua_domain_id, wrong)
    assert "/follower_arm: failed in step configure: /dev/ttyACM77: no such serial port. Ports here:" in text
    assert text.count("serial_number finds it under any path") == 1


def test_an_adapter_that_is_not_plugged_in_is_named(
    leader: EmulatedBus, follower: EmulatedBus, tmp_path: Path, joshua_domain_id: int
) -> None:
    wrong = f'{FOLLOWER}.comm.serial.serial_number="5A46000000"'
    text = refused(leader, follower, tmp_path, joshua_domain_id, wrong)
    assert "serial_number 5A46000000: no adapter with this identity is plugged in" in text
    assert "joshua find-port lists the ports" in text


def test_a_port_that_another_program_has_names_it(
    leader: EmulatedBus, follower: EmulatedBus, tmp_path: Path, joshua_domain_id: int
) -> None:
    port = SerialPort(Endpoint(follower.port), 1_000_000)
    port.open()
    try:
        text = refused(leader, follower, tmp_path, joshua_domain_id)
    finally:
        port.close()
    assert f"the port is in use by {Path(f'/proc/{os.getpid()}/comm').read_text().strip()} (process" in text
    assert "Two programs cannot share a bus" in text


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can act as another user")
def test_a_port_without_permission_names_the_remedy(follower: EmulatedBus, tmp_path: Path) -> None:
    # Another user starts the driver on a terminal that belongs to this one.
    for folder in (follower.root, follower.root / "dev"):
        folder.chmod(0o755)
    program = """
import os, sys
from joshua.devices.errors import DeviceError
from joshua_serial.port import SerialPort
from joshua_serial.usb_ports import Endpoint
os.setgroups([])
os.setgid(65534)
os.setuid(65534)
try:
    SerialPort(Endpoint(sys.argv[1]), 1000000).open()
except DeviceError as error:
    print(error)
"""
    result = subprocess.run(
        [sys.executable, "-c", program, follower.port], capture_output=True, text=True, timeout=60
    )
    assert "this user may not open the port" in result.stdout, result.stderr
    assert "joshua doctor" in result.stdout or "usermod" in result.stdout


def test_a_wrong_line_speed_is_named_with_the_right_one(
    leader: EmulatedBus, tmp_path: Path, joshua_domain_id: int
) -> None:
    with EmulatedBus(arm="so_arm100", calibrated=True, identity="FOLLOWER", baudrate=500_000) as follower:
        text = refused(leader, follower, tmp_path, joshua_domain_id)
    assert "no servo answers at 1000000 bit/s, but ids 1, 2, 3, 4, 5, 6 answer at 500000" in text
    assert "set baudrate: 500000, or change the servos with joshua motors setup" in text


def test_two_motors_with_one_id_are_named(
    leader: EmulatedBus, follower: EmulatedBus, tmp_path: Path, joshua_domain_id: int
) -> None:
    follower.fault("duplicate", 4)
    text = refused(leader, follower, tmp_path, joshua_domain_id)
    assert "two motors share the id 4: connect one alone and change its id" in text
    assert "joshua motors setup" in text


def test_a_missing_motor_is_named_with_those_that_are_there(
    leader: EmulatedBus, follower: EmulatedBus, tmp_path: Path, joshua_domain_id: int
) -> None:
    follower.fault("silent", 3)
    text = refused(leader, follower, tmp_path, joshua_domain_id)
    assert "missing ids: 3" in text
    assert "expected: 1 (STS3215), 2" in text
    assert "found: 1 (STS3215, firmware 3.10), 2" in text


def test_an_arm_without_supply_is_told_from_a_wrong_speed(
    leader: EmulatedBus, follower: EmulatedBus, tmp_path: Path, joshua_domain_id: int
) -> None:
    follower.fault("silent")
    text = refused(leader, follower, tmp_path, joshua_domain_id)
    assert "no servo answers at any line speed: check the supply, and the cable to the first servo" in text


def test_an_arm_without_calibration_gets_no_torque(
    leader: EmulatedBus, follower: EmulatedBus, tmp_path: Path, joshua_domain_id: int
) -> None:
    with teleoperation(
        leader, follower, tmp_path, joshua_domain_id, overrides=("calibration={}",)
    ) as process:
        code, output = Watched(process).end()
    assert code == 4, output
    assert "is not calibrated" in output
    assert "--allow-uncalibrated" in output
    for arm in (leader, follower):
        assert not any(entry["on"] for entry in arm.log("torque"))


def test_a_dry_run_teleoperates_with_torque_off(
    leader: EmulatedBus, follower: EmulatedBus, tmp_path: Path, joshua_domain_id: int
) -> None:
    with teleoperation(
        leader, follower, tmp_path, joshua_domain_id, options=("--dry-run", "--duration", "4")
    ) as process:
        watched = Watched(process)
        watched.wait("nodes ready")
        leader.hand(dict(zip(range(1, 7), POSE, strict=True)), duration_s=0.5)
        code, output = watched.end()
    assert code == 0, output
    for arm in (leader, follower):
        assert not any(entry["on"] for entry in arm.log("torque"))
        assert True not in energised(arm)
    assert "/follower_arm/applied_command" in output  # what would have been written is published


def test_unplugged_while_moving_and_back_under_another_name(
    leader: EmulatedBus, follower: EmulatedBus, tmp_path: Path, joshua_domain_id: int
) -> None:
    by_identity = f"{FOLLOWER}.comm.serial.port={follower.by_id}"
    with teleoperation(leader, follower, tmp_path, joshua_domain_id, overrides=(by_identity,)) as process:
        watched = Watched(process)
        watched.wait("nodes ready")
        wait_until(lambda: energised(follower) == {True})
        leader.hand(dict(zip(range(1, 7), POSE, strict=True)), duration_s=2.0)
        follower.fault("unplug")
        watched.wait("the adapter is gone")
        follower.fault("replug", name="ttyUSB7")
        watched.wait("restarted after a failure")
        before = [servo["goal_position"] for servo in follower.servos()]
        leader.hand(dict.fromkeys(range(1, 7), 2048.0), duration_s=0.3)
        time.sleep(0.6)
        assert [servo["goal_position"] for servo in follower.servos()] == before  # not unasked
        environment = {**os.environ, "XDG_RUNTIME_DIR": str(tmp_path / "run")}
        result = subprocess.run(
            [str(JOSHUA), "resume", "follower_arm"],
            capture_output=True,
            text=True,
            timeout=60,
            env=environment,
        )
        assert result.returncode == 0, result.stdout + result.stderr + watched.text
        wait_until(lambda: all(abs(servo["present_position"] - 2048) <= 4 for servo in follower.servos()))
        process.send_signal(signal.SIGINT)
        code, output = watched.end()
    assert "Traceback" not in output
    assert "/follower_arm" in output
    assert code in (0, 1), output


def test_a_power_cut_takes_the_torque_and_is_called_by_its_name(
    leader: EmulatedBus, follower: EmulatedBus, tmp_path: Path, joshua_domain_id: int
) -> None:
    with teleoperation(leader, follower, tmp_path, joshua_domain_id) as process:
        watched = Watched(process)
        watched.wait("nodes ready")
        wait_until(lambda: energised(follower) == {True})
        follower.fault("brown_out")
        watched.wait("the supply was interrupted")
        wait_until(lambda: energised(follower) == {False})
        process.send_signal(signal.SIGINT)
        _, output = watched.end()
    assert "Traceback" not in output


def test_a_second_run_on_the_same_port_names_the_first(
    leader: EmulatedBus, follower: EmulatedBus, tmp_path: Path, joshua_domain_id: int
) -> None:
    other = tmp_path / "other.pbtxt"
    other.write_text(f"""
        general {{ mode: MODE_TEST id: "other" name: "other" }}
        robot {{ actions {{
          node {{ node_name: "somebody" node_id: 1 node_type: PYTHON
            publishers {{ data_type: JOINT_STATE topic_name: "/somebody" publish_rate_hz: 20 }} }}
          action_type: ACTION_LEADER
          sts3215_config {{
            comm {{ serial {{ port: "{follower.port}" baudrate: 1000000 }} }}
            motor_ids: [1, 2, 3, 4, 5, 6] position_min: 0 position_max: 4095 velocity: 1000 }}
        }} }}""")
    with teleoperation(leader, follower, tmp_path, joshua_domain_id) as process:
        watched = Watched(process)
        watched.wait("nodes ready")
        environment = {
            **os.environ,
            "ROS_DOMAIN_ID": str(joshua_domain_id),
            "XDG_RUNTIME_DIR": str(tmp_path / "run"),
        }
        second = subprocess.run(
            [str(JOSHUA), "--config", str(other)], capture_output=True, text=True, timeout=60, env=environment
        )
        listing = subprocess.run(
            [str(JOSHUA), "find-port", "--port", follower.port],
            capture_output=True,
            text=True,
            timeout=60,
            env=environment,
        )
        wait_until(lambda: energised(follower) == {True})  # the first run is not disturbed
        process.send_signal(signal.SIGINT)
        watched.end()
    assert second.returncode == 4, second.stdout + second.stderr
    assert "the port is in use by" in second.stderr + second.stdout
    assert "joshua stop" in second.stderr + second.stdout
    assert listing.returncode == 4
    assert f"in use by /follower_arm of {tmp_path}/teleop.pbtxt: run `joshua stop`" in listing.stdout

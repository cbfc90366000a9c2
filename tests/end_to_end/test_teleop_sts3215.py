"""Teleoperation of two SO-ARM100 by the shipped preset, with emulated servo buses in place of the arms."""

from __future__ import annotations

import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from emulated_teleop import teleoperation
from joshua_emulator import EmulatedBus
from joshua_serial.port import SerialPort
from joshua_serial.usb_ports import Endpoint
from joshua_sts3215.bus import Bus
from joshua_sts3215.registers import TORQUE_ENABLE


def wait(condition: Callable[[], bool], process: subprocess.Popen[str], timeout_s: float = 60.0) -> None:
    """Waits until something holds; says what the program printed where it does not come to that."""
    deadline_s = time.monotonic() + timeout_s
    while not condition():
        if process.poll() is not None or time.monotonic() > deadline_s:
            process.kill()
            pytest.fail(f"exit code {process.poll()}; output:\n{process.communicate()[0]}")
        time.sleep(0.05)


def positions(arm: EmulatedBus) -> list[int]:
    return [servo["present_position"] for servo in arm.servos()]


def energised(arm: EmulatedBus) -> set[bool]:
    return {servo["energised"] for servo in arm.servos()}


def energise(arm: EmulatedBus) -> None:
    """Leaves the torque on, as a run that ended in HOLD does."""
    port = SerialPort(Endpoint(arm.port), 1_000_000)
    port.open()
    for servo in arm.servos():
        Bus(port).write(servo["id"], TORQUE_ENABLE, 1)
    port.close()


@pytest.mark.timing
def test_the_follower_repeats_what_a_hand_does_with_the_leader(tmp_path: Path, joshua_domain_id: int) -> None:
    with (
        EmulatedBus(arm="so_arm100", calibrated=True, identity="LEADER") as leader,
        EmulatedBus(arm="so_arm100", calibrated=True, identity="FOLLOWER") as follower,
    ):
        energise(leader)
        with teleoperation(leader, follower, tmp_path, joshua_domain_id) as process:
            wait(lambda: energised(follower) == {True}, process)
            wait(lambda: energised(leader) == {False}, process)
            for pose in ([2300, 1900, 2200, 2000, 2150, 2100], [1900, 2100, 1950, 2150, 1950, 2000]):
                leader.hand(dict(zip(range(1, 7), pose, strict=True)), duration_s=0.5)
                wait(lambda pose=pose: positions(leader) == pose, process)  # type: ignore[misc]
                wait(
                    lambda pose=pose: all(
                        abs(a - b) <= 3 for a, b in zip(positions(follower), pose, strict=True)
                    ),  # type: ignore[misc]
                    process,
                )
            process.send_signal(signal.SIGINT)
            output, _ = process.communicate(timeout=60)
            assert process.returncode == 0, output
        assert energised(follower) == {True}  # held, so that the arm does not fall
        assert energised(leader) == {False}


def test_an_arm_that_is_not_there_ends_the_start(tmp_path: Path, joshua_domain_id: int) -> None:
    with (
        EmulatedBus(arm="so_arm100", calibrated=True, identity="LEADER") as leader,
        EmulatedBus(arm="so_arm100", calibrated=True, identity="FOLLOWER") as follower,
    ):
        follower.fault("break_after", 4)
        with teleoperation(leader, follower, tmp_path, joshua_domain_id) as process:
            output, _ = process.communicate(timeout=60)
        assert process.returncode == 4, output
        assert "missing ids: 5, 6" in output
        assert "the chain breaks after id 4" in output
        assert "Traceback" not in output
        assert True not in energised(follower)

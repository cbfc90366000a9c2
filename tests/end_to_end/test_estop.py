"""``joshua estop`` on an emulated follower, whatever is dead or hung: torque as the servos tell it."""

from __future__ import annotations

import os
import re
import signal
import time
from pathlib import Path

import pytest
from guarded_arm import HOLD, RELEASE, Rig, park, running
from steady_machine import STOOD_STILL_S, SteadyMachine

pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="finds processes in /proc")

LATCHED = "the e-stop of so-arm100 is latched since"

#: By its driver, or by its guardian where a busy machine held the driver up.
READ_BACK = "{:14} off     read back from 6 joints by its "


def rows(output: str) -> list[str]:
    return [line.strip() for line in output.splitlines()]


def is_off(output: str, node: str) -> bool:
    return any(row.startswith(READ_BACK.format(node)) for row in rows(output))


def resume(rig: Rig) -> str:
    answer = rig.joshua("resume", "follower_arm")
    return answer.stdout + answer.stderr


@pytest.mark.parametrize("state", [HOLD, RELEASE, park(0.1)], ids=["hold", "release", "park"])
def test_torque_goes_whatever_the_safe_state_is(
    tmp_path: Path, joshua_domain_id: int, state: tuple[str, ...]
) -> None:
    with running(tmp_path, joshua_domain_id, state) as rig:
        before = [servo["present_position"] for servo in rig.follower.servos()]
        result = rig.joshua("estop")
        assert rig.energised() == {False}, "when the command has ended, the torque is off"
        assert result.returncode == 0, result.stdout + result.stderr
        assert is_off(result.stdout, "/follower_arm")
        assert is_off(result.stdout, "/leader_arm")
        assert rows(result.stdout)[-1] == "Torque stays off until you run: joshua estop --release"
        after = [servo["present_position"] for servo in rig.follower.servos()]
        assert all(abs(new - old) < 40 for new, old in zip(after, before, strict=True)), "it does not park"
        rig.wait(lambda: rig.gone(rig.guardian))

        rig.wait(lambda: LATCHED in resume(rig))  # a busy machine may have to start the driver again
        assert rig.energised() == {False}
        rig.wait(lambda: "fault" in rig.joshua("status").stdout)
        released = rig.joshua("estop", "--release")
        assert released.returncode == 0, released.stderr
        assert "Torque is still off. Run `joshua resume NODE` to re-enable it." in released.stdout
        time.sleep(0.2)
        assert rig.energised() == {False}
        assert "torque is on again" in resume(rig)
        assert rig.energised() == {True}
        output = rig.stop()
        assert "the e-stop is latched by process" in output
        assert rig.process.returncode == 0, output


def test_a_second_estop_is_verified_again(tmp_path: Path, joshua_domain_id: int) -> None:
    with running(tmp_path, joshua_domain_id, HOLD) as rig:
        for _ in range(2):
            result = rig.joshua("estop")
            assert result.returncode == 0, result.stderr
            assert is_off(result.stdout, "/follower_arm")
        assert rig.energised() == {False}


def test_a_hung_supervisor_is_not_needed(tmp_path: Path, joshua_domain_id: int) -> None:
    with running(tmp_path, joshua_domain_id, HOLD) as rig:
        os.kill(rig.process.pid, signal.SIGSTOP)
        result = rig.joshua("estop")
        assert rig.energised() == {False}
        assert result.returncode == 0, result.stdout + result.stderr
        assert is_off(result.stdout, "/follower_arm")
        assert f"the supervisor, process {rig.process.pid}, does not answer: no answer" in result.stdout


@pytest.mark.timing
def test_a_hung_driver_is_replaced_by_its_guardian(tmp_path: Path, joshua_domain_id: int) -> None:
    # the command reaches the guardian before the guardian finds the hang by itself
    patient = (*HOLD, "robot.actions[1].hang_after_s=2")
    with running(tmp_path, joshua_domain_id, patient) as rig:
        os.kill(rig.process.pid, signal.SIGSTOP)  # which would end the driver, too
        with SteadyMachine() as machine:
            os.kill(rig.driver, signal.SIGSTOP)
            result = rig.joshua("estop")
        assert rig.energised() == {False}
        assert result.returncode == 0, result.stdout + result.stderr
        by = "guardian" if machine.latest_s < STOOD_STILL_S else "(guardian|command)"
        row = rf"/follower_arm  off     read back from 6 joints by (its|this) {by}"
        assert any(re.fullmatch(row, line) for line in rows(result.stdout)), result.stdout
        assert rig.gone(rig.driver)


def test_a_driver_that_dies_afterwards_is_not_held(tmp_path: Path, joshua_domain_id: int) -> None:
    """The latch stands before the driver dies: its guardian, told to hold, lets go all the same."""
    with running(tmp_path, joshua_domain_id, HOLD) as rig:
        os.kill(rig.driver, signal.SIGSTOP)
        os.kill(rig.driver, signal.SIGKILL)
        result = rig.joshua("estop")
        assert rig.energised() == {False}
        assert result.returncode == 0, result.stdout + result.stderr


def test_an_arm_that_holds_after_its_supervisor_was_killed(tmp_path: Path, joshua_domain_id: int) -> None:
    with running(tmp_path, joshua_domain_id, HOLD) as rig:
        rig.process.kill()
        rig.wait(lambda: rig.gone(rig.guardian) and rig.gone(rig.driver))
        assert rig.energised() == {True}
        result = rig.joshua("estop")
        assert rig.energised() == {False}
        assert result.returncode == 0, result.stdout + result.stderr
        assert "/follower_arm  off     read back from 6 joints by this command" in rows(result.stdout)


def test_parking_ends_at_once(tmp_path: Path, joshua_domain_id: int) -> None:
    patient = (*park(-1.6), "robot.actions[1].park_timeout_s=60")
    with running(tmp_path, joshua_domain_id, patient) as rig:
        rig.process.send_signal(signal.SIGINT)
        middle = [servo["present_position"] for servo in rig.follower.servos()]
        rig.wait(lambda: rig.follower.servos()[3]["present_position"] < middle[3] - 60)
        rig.follower.ask("set", id=4, blocked=True)  # it stays on its way, however long the command takes
        assert rig.energised() == {True}
        result = rig.joshua("estop")
        assert rig.energised() == {False}
        assert result.returncode == 0, result.stdout + result.stderr
        goal = 2048 - round(1.6 / 6.28319 * 4096)
        assert rig.follower.servos()[3]["present_position"] > goal + 100, "it was on its way"


def test_an_unplugged_arm_is_not_called_stopped(tmp_path: Path, joshua_domain_id: int) -> None:
    short = (*HOLD, "robot.actions[1].park_timeout_s=0.5")
    with running(tmp_path, joshua_domain_id, short) as rig:
        rig.follower.fault("unplug")
        result = rig.joshua("estop", "--timeout", "4")
        assert result.returncode == 4, result.stdout
        assert "/leader_arm    off      read back from 6 joints by its driver" in rows(result.stdout)
        (line,) = [line for line in rows(result.stdout) if line.startswith("/follower_arm")]
        assert line.startswith("/follower_arm  UNKNOWN  not confirmed:"), line
        assert line.endswith("Cut its power by hand")


def test_a_silent_servo_is_named(tmp_path: Path, joshua_domain_id: int) -> None:
    short = (*HOLD, "robot.actions[1].park_timeout_s=0.5")
    with running(tmp_path, joshua_domain_id, short) as rig:
        rig.follower.fault("silent", 5)
        result = rig.joshua("estop", "--timeout", "4")
        assert result.returncode == 4, result.stdout
        assert {servo["energised"] for servo in rig.follower.servos() if servo["id"] != 5} == {False}
        (line,) = [line for line in rows(result.stdout) if line.startswith("/follower_arm")]
        assert "UNKNOWN  not confirmed: only 1, 2, 3, 4, 6 confirmed; ids 5 did not confirm" in line


def test_a_run_that_starts_while_the_latch_stands_gets_no_torque(
    tmp_path: Path, joshua_domain_id: int
) -> None:
    with running(tmp_path, joshua_domain_id, HOLD) as rig:
        assert rig.joshua("estop").returncode == 0
        rig.stop()
        config = str(rig.folder / "teleop.pbtxt")
        ports = (rig.leader.port, rig.follower.port)
        values = [
            f"--set=robot.actions[{index}].sts3215_config.comm.serial.port={port}"
            for index, port in enumerate(ports)
        ]
        again = rig.joshua("--config", config, *values, "--duration", "1")
        assert again.returncode == 1, again.stdout
        said = again.stdout + again.stderr
        assert "/follower_arm: torque off, read back from 6 joints: the e-stop of so-arm100" in said
        assert rig.energised() == {False}


def test_an_arm_that_holds_after_its_run_is_reached_by_its_file(
    tmp_path: Path, joshua_domain_id: int
) -> None:
    with running(tmp_path, joshua_domain_id, HOLD) as rig:
        rig.stop()
        assert rig.energised() == {True}
        values = [
            f"--set=robot.actions[{index}].sts3215_config.comm.serial.port={bus.port}"
            for index, bus in enumerate((rig.leader, rig.follower))
        ]
        result = rig.joshua("estop", "--config", str(rig.folder / "teleop.pbtxt"), *values)
        assert rig.energised() == {False}
        assert result.returncode == 0, result.stdout + result.stderr
        assert "/follower_arm  off     read back from 6 joints by this command" in rows(result.stdout)
        assert "/leader_arm    off     read back from 6 joints by this command" in rows(result.stdout)

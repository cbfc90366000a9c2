"""An emulated arm that keeps its torque after its run is named until it is released, and how that is done."""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from emulated_teleop import PRESET, teleoperation
from guarded_arm import HOLD, RELEASE, Rig, park, running
from joshua_emulator import EmulatedBus, EmulatedEncoder
from processes import descendants_of

pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="finds processes in /proc")

HOLDS = "/follower_arm holds its position with torque. To release it, which lets it sink: "


ENCODER = """
robot {
  perceptions {
    node {
      node_name: "wheel" node_id: 9
      publishers { data_type: JOINT_STATE topic_name: "/wheel/joint_states" publish_rate_hz: 50.0 }
    }
    perception_type: PERCEPTION_ENCODER
    encoder_config { comm { serial { port: "PORT" baudrate: 115200 } } protocol: "as5600" resolution: 4096 }
  }
}
"""


def last_line(output: str) -> str:
    return output.rstrip().splitlines()[-1]


def command_of(line: str) -> list[str]:
    """The command of a last line, as a shell reads it."""
    command = shlex.split(line.removeprefix(HOLDS))
    assert command[:2] == ["joshua", "estop"], line
    return command[1:]


def released_by(rig: Rig, line: str) -> None:
    """Runs the printed command; the arm is off, and nothing mentions it any more."""
    result = rig.joshua(*command_of(line))
    assert result.returncode == 0, result.stdout + result.stderr
    assert rig.energised() == {False}
    assert "/follower_arm" not in rig.joshua("status").stdout


def kill_everything(rig: Rig) -> None:
    left = [rig.process.pid, *descendants_of(rig.process.pid), rig.driver, rig.guardian]
    for number in (signal.SIGSTOP, signal.SIGKILL):  # stopped first: a guardian acts within milliseconds
        for process_id in left:
            os.kill(process_id, number)
    rig.wait(lambda: all(rig.gone(number) for number in left if number != rig.process.pid))
    rig.process.wait()


def restart(rig: Rig, *words: str) -> subprocess.CompletedProcess[str]:
    return rig.joshua("--config", str(rig.folder / "teleop.pbtxt"), *words)


def test_an_ordinary_end_and_the_status_name_the_arm_that_holds(
    tmp_path: Path, joshua_domain_id: int
) -> None:
    with running(tmp_path, joshua_domain_id, HOLD) as rig:
        assert HOLDS not in rig.joshua("status").stdout, "it belongs to a run"
        output = rig.stop()
        assert rig.process.returncode == 0, output
        assert rig.energised() == {True}
        assert last_line(output).startswith(HOLDS), output
        assert last_line(rig.joshua("status").stdout) == last_line(output)
        released_by(rig, last_line(output))


@pytest.mark.parametrize("state", [RELEASE, park(0.1)], ids=["release", "park"])
def test_an_arm_without_torque_is_not_mentioned(
    tmp_path: Path, joshua_domain_id: int, state: tuple[str, ...]
) -> None:
    with running(tmp_path, joshua_domain_id, state) as rig:
        output = rig.stop()
        assert rig.energised() == {False}
        assert last_line(output) == "this run left no torque on"
        assert rig.joshua("status").stdout == "no system is running\n"


def test_after_an_estop_the_last_line_names_the_command_that_releases_it(
    tmp_path: Path, joshua_domain_id: int
) -> None:
    with running(tmp_path, joshua_domain_id, HOLD) as rig:
        assert rig.joshua("estop").returncode == 0
        output = rig.stop()
        assert rig.process.returncode == 1, output
        assert rig.energised() == {False}
        said, _, command = last_line(output).rpartition(": ")
        assert said == "this run left no torque on, and the e-stop stays latched; look at the robot, then"
        assert command == "joshua estop --release"
        assert rig.joshua(*command.split()[1:]).returncode == 0
        assert rig.joshua("status").stdout == "no system is running\n"


def test_after_ctrl_c_during_the_start_the_last_line_names_the_command_that_starts_it_again(
    tmp_path: Path, joshua_domain_id: int
) -> None:
    with (
        EmulatedEncoder("as5600", fault=["silent"]) as silent,
        EmulatedBus(arm="so_arm100", calibrated=True, identity="LEADER") as leader,
        EmulatedBus(arm="so_arm100", calibrated=True, identity="FOLLOWER") as follower,
    ):
        (tmp_path / "encoder.pbtxt").write_text(ENCODER.replace("PORT", silent.port))
        text = f'include: "encoder.pbtxt"\n{PRESET.read_text()}'
        with teleoperation(leader, follower, tmp_path, joshua_domain_id, text=text) as process:
            logs, begun = tmp_path / "log", '"node": "/wheel", "text": "step: configure"'
            deadline_s = time.monotonic() + 60
            # The start waits seconds for a line of the encoder.
            while not any(begun in path.read_text() for path in logs.glob("*.jsonl")):
                assert time.monotonic() < deadline_s
                time.sleep(0.02)
            process.send_signal(signal.SIGINT)
            output = process.communicate(timeout=60)[0]
            assert process.returncode == 130, output
            assert not any(servo["energised"] for servo in follower.servos())
            said, _, command = last_line(output).partition("; to start it again: ")
            assert said == "this run left no torque on", output
            words = shlex.split(command)
            assert words[:2] == ["joshua", "--config"]
            again = subprocess.run(
                [sys.executable, "-m", "joshua.cli.main", *words[1:], "--validate-only"], text=True
            )
            assert again.returncode == 0


def test_an_arm_that_was_left_by_killed_processes_is_named_after_a_failed_start(
    tmp_path: Path, joshua_domain_id: int
) -> None:
    with running(tmp_path, joshua_domain_id, HOLD) as rig:
        kill_everything(rig)
        assert rig.energised() == {True}
        assert last_line(rig.joshua("status").stdout).startswith(HOLDS)
        # The port of its leader is none: the start fails after its own port was opened.
        port = f"robot.actions[1].sts3215_config.comm.serial.port={rig.follower.port}"
        failed = restart(rig, "--set", port)
        assert failed.returncode == 4, failed.stdout + failed.stderr
        assert rig.energised() == {True}
        assert last_line(failed.stdout).startswith(HOLDS), failed.stdout
        released_by(rig, last_line(failed.stdout))


def test_a_file_that_is_invalid_meanwhile_releases_it_all_the_same(
    tmp_path: Path, joshua_domain_id: int
) -> None:
    with running(tmp_path, joshua_domain_id, HOLD) as rig:
        rig.stop()
        file = rig.folder / "teleop.pbtxt"
        file.write_text(file.read_text() + "\nnonsense")
        invalid = restart(rig)
        assert invalid.returncode == 2
        assert last_line(invalid.stdout).startswith(HOLDS)
        result = rig.joshua("estop", str(file))
        assert result.returncode == 0, result.stdout + result.stderr
        assert rig.energised() == {False}


def test_an_estop_without_a_file_releases_every_arm_that_holds(tmp_path: Path, joshua_domain_id: int) -> None:
    with running(tmp_path, joshua_domain_id, HOLD) as rig:
        rig.stop()
        result = rig.joshua("estop")
        assert result.returncode == 0, result.stdout + result.stderr
        assert "/follower_arm  off     read back from 6 joints by this command" in result.stdout
        assert rig.energised() == {False}
        assert HOLDS not in rig.joshua("status").stdout


def test_the_command_works_from_where_the_user_is(tmp_path: Path, joshua_domain_id: int) -> None:
    with running(tmp_path, joshua_domain_id, HOLD) as rig:
        rig.stop()
        shown = subprocess.run(
            [sys.executable, "-m", "joshua.cli.main", "status"],
            env=rig.environment,
            cwd=rig.folder,
            capture_output=True,
            text=True,
            timeout=90,
        ).stdout
        assert f"{HOLDS}joshua estop teleop.pbtxt --set " in shown

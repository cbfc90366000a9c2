"""Whole runs: tiny policies drive an emulated arm by what mock cameras show."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import tiny_policies
from checkpoints import write_robot
from hub import hub
from joshua.testing.domain import reserved_domain

ARM = """sts3215_config {
      comm { serial { port: "/dev/ttyACM0" baudrate: 1000000 } }
      motor_ids: [1, 2, 3, 4, 5, 6] position_max: 4095 velocity: 1000 acceleration: 200
    }"""
OPTIONS = ["--emulate", "--duration", "3", "--start-timeout", "300"]
CAMERAS = {"top": (96, 96), "wrist": (96, 96)}


def run(robot: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Runs a file for some seconds on the emulated arm."""
    text = re.sub(r"mock_motor_config \{[^}]*\}", ARM, robot.read_text())
    robot.write_text(text)
    with reserved_domain() as domain:
        return subprocess.run(
            [sys.executable, "-m", "joshua", "--config", str(robot), *OPTIONS],
            capture_output=True,
            text=True,
            cwd=robot.parent,
            env={
                **os.environ,
                "ROS_DOMAIN_ID": str(domain),
                "XDG_RUNTIME_DIR": str(robot.parent),
                "XDG_STATE_HOME": str(robot.parent / "state"),
                **environment,
            },
            timeout=240,
            check=False,
        )


def actions(done: subprocess.CompletedProcess[str]) -> int:
    """How many commands the arm received."""
    row = re.search(r"in /ai/actions.* (\d+)$", done.stdout, re.MULTILINE)
    return int(row[1]) if row else 0


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    tmp_path.chmod(0o700)
    return tmp_path


def test_an_act_of_the_hub_drives_the_arm(folder: Path) -> None:
    tiny_policies.make_act(folder / "act")
    with hub() as served:
        served.folders["acme/act"] = folder / "act"
        robot = write_robot(folder / "robot.pbtxt", "acme/act", cameras=CAMERAS)
        done = run(robot, HF_ENDPOINT=served.endpoint, HF_HOME=str(folder / "hf"), HF_HUB_OFFLINE="0")
    assert done.returncode == 0, done.stdout + done.stderr
    assert actions(done) > 30, done.stdout
    assert "Traceback" not in done.stderr


def test_smolvla_drives_the_arm_by_its_task(folder: Path) -> None:
    tiny_policies.make_smolvla(folder / "smolvla")
    task = 'task: "put the red cube into the box"'
    robot = write_robot(
        folder / "robot.pbtxt", "smolvla", model_type="SMOLVLA", block="", cameras=CAMERAS, extra=task
    )
    done = run(robot)
    assert done.returncode == 0, done.stdout + done.stderr
    assert actions(done) > 30, done.stdout


def test_a_checkpoint_of_the_hub_for_other_cameras_is_refused_before_anything_moves(folder: Path) -> None:
    tiny_policies.make_act(folder / "act", ("side",))
    with hub() as served:
        served.folders["acme/act"] = folder / "act"
        robot = write_robot(folder / "robot.pbtxt", "acme/act", cameras=CAMERAS)
        done = run(robot, HF_ENDPOINT=served.endpoint, HF_HOME=str(folder / "hf"), HF_HUB_OFFLINE="0")
    assert done.returncode == 1, done.stdout + done.stderr
    assert "needs observation.images.side" in done.stderr
    assert "Traceback" not in done.stderr
    assert actions(done) == 0

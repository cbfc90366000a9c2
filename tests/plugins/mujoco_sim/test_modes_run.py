"""The four modes as a user starts them: whole runs with real processes and topics."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.parquet
import pytest
import virtual_screen
from joshua.testing.domain import reserved_domain
from joshua.testing.program import JoshuaProgram
from sim_configs import simulation_file

CONFIGS = Path(__file__).resolve().parents[3] / "configs"


def run(path: Path, *options: str, environment: dict[str, str] | None = None, timeout_s: float = 200):
    """Runs ``joshua --config path`` to its end."""
    with reserved_domain() as domain:
        command = [sys.executable, "-m", "joshua.cli.main", "--config", str(path), *options]
        variables = os.environ | {"ROS_DOMAIN_ID": str(domain)} | (environment or {})
        return subprocess.run(command, capture_output=True, text=True, env=variables, timeout=timeout_s)


def test_offscreen_draws_and_moves(tmp_path: Path) -> None:
    path = tmp_path / "robot.pbtxt"
    path.write_text(simulation_file())
    ended = run(path, "--duration", "3")
    assert ended.returncode == 0, ended.stderr
    assert "/camera/image_raw" in ended.stdout
    assert "real-time factor" in ended.stderr


DIVERGING = """
<mujoco><option timestep="0.01" integrator="Euler"/>
<worldbody><body><joint name="hinge"/><geom size=".02" pos=".1 0 0" mass="0.001"/></body></worldbody>
<actuator><position name="hinge" joint="hinge" kp="5000"/></actuator>
<keyframe><key name="home" qpos="0.5"/></keyframe></mujoco>
"""


def test_divergence_ends_the_run_where_the_file_says_so(tmp_path: Path) -> None:
    (tmp_path / "bad.xml").write_text(DIVERGING)
    path = tmp_path / "robot.pbtxt"
    path.write_text(
        'general { mode: MODE_SIMULATION name: "d" id: "diverging-test" }\n'
        'simulation { mode: OFFSCREEN model_path: "bad.xml" on_divergence: DIVERGENCE_STOP_RUN }\n'
    )
    ended = run(path, "--duration", "30")
    assert ended.returncode == 1, ended.stderr
    assert "the simulation diverged at 0.0" in ended.stderr
    assert "hinge has a speed of" in ended.stderr
    assert "starting again" not in ended.stderr


def test_passive_reports_and_ends_by_itself(tmp_path: Path) -> None:
    (tmp_path / "wave.csv").write_text(
        "time_s,shoulder_pan\n" + "".join(f"{i / 50},{2.5 * np.sin(i / 10):.3f}\n" for i in range(60))
    )
    path = tmp_path / "robot.pbtxt"
    path.write_text(
        'general { mode: MODE_SIMULATION name: "p" id: "passive-test" }\n'
        'simulation { mode: PASSIVE model_path: "so_arm100/scene.xml" trajectory_path: "wave.csv" }\n'
    )
    ended = run(path)
    assert ended.returncode == 0, ended.stderr
    assert "limit exceeded: shoulder_pan at" in ended.stderr
    assert "replayed 60 samples of 1 recording(s)" in ended.stderr


def test_passive_says_what_is_wrong_with_its_file(tmp_path: Path) -> None:
    path = tmp_path / "robot.pbtxt"
    path.write_text(
        'general { mode: MODE_SIMULATION name: "p" id: "passive-test" }\n'
        'simulation { mode: PASSIVE model_path: "so_arm100/scene.xml" trajectory_path: "no.csv" }\n'
    )
    ended = run(path)
    assert ended.returncode == 2
    assert "recording does not exist: looked for" in " ".join(ended.stderr.split())


def test_interactive_without_a_screen_says_what_to_do() -> None:
    ended = run(CONFIGS / "sim_interactive.pbtxt", environment={"DISPLAY": "", "WAYLAND_DISPLAY": ""})
    assert ended.returncode != 0
    assert "no display: neither DISPLAY nor WAYLAND_DISPLAY is set" in ended.stderr
    assert "xvfb-run -a joshua" in ended.stderr


def test_interactive_with_a_screen_that_is_not_there() -> None:
    ended = run(CONFIGS / "sim_interactive.pbtxt", environment={"DISPLAY": ":9999"})
    assert ended.returncode != 0
    assert "the display :9999 cannot be opened" in ended.stderr


@pytest.mark.parametrize(
    ("value", "problem", "remedy"),
    [
        ("banana", "MUJOCO_GL is 'banana', which MuJoCo does not know", "Unset MUJOCO_GL, or set it to"),
        ("glfw", "MUJOCO_GL=glfw draws in a window, and neither DISPLAY", "set MUJOCO_GL=egl"),
    ],
)
def test_an_opengl_that_cannot_draw_is_one_error_before_the_start(
    value: str, problem: str, remedy: str, tmp_path: Path
) -> None:
    path = tmp_path / "robot.pbtxt"
    path.write_text(simulation_file())
    ended = run(path, environment={"MUJOCO_GL": value, "DISPLAY": "", "WAYLAND_DISPLAY": ""})
    text = " ".join(ended.stderr.split())
    assert ended.returncode == 4, text
    assert problem in text
    assert remedy in text
    assert "1 error in" in text
    assert "nothing was started" in text


def test_a_camera_that_the_model_lacks_is_an_error_of_the_file_at_every_start(tmp_path: Path) -> None:
    (tmp_path / "arm.xml").write_text(
        "<mujoco><worldbody><body><geom size='.1'/><joint name='hinge'/></body></worldbody>"
        "<actuator><position name='drive' joint='hinge'/></actuator></mujoco>"
    )
    path = tmp_path / "robot.pbtxt"
    text = simulation_file(arm="", camera="overviev").replace("so_arm100/scene.xml", "arm.xml")
    path.write_text(text)
    for options in (("--validate-only",), ("--duration", "1")):
        ended = run(path, *options)
        assert ended.returncode == 2, ended.stderr
        assert "has no camera named 'overviev'" in ended.stderr
        assert "Did you mean overview?" in ended.stderr
    path.write_text(text.replace("overviev", "overview"))
    ended = run(path, "--duration", "2")
    assert ended.returncode == 0, ended.stderr


@pytest.fixture
def screen(tmp_path: Path):
    """What DISPLAY must say for a virtual screen."""
    if not virtual_screen.available():
        pytest.skip("no virtual screen here: sudo apt install xvfb")
    with virtual_screen.virtual_screen(tmp_path) as display:
        yield display


@pytest.mark.parametrize("preset", ["sim_interactive", "sim_lekoch", "sim_mirror"])
def test_interactive_shows_the_model_in_a_window(preset: str, screen: str, tmp_path: Path) -> None:
    with reserved_domain() as domain:
        program = subprocess.Popen(
            [sys.executable, "-m", "joshua.cli.main", "--config", str(CONFIGS / f"{preset}.pbtxt")],
            env=os.environ | {"ROS_DOMAIN_ID": str(domain), "DISPLAY": screen},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        try:
            end = time.monotonic() + 60
            while virtual_screen.colours(tmp_path) < 100:
                assert program.poll() is None, program.communicate()[0]
                assert time.monotonic() < end, "nothing was drawn"
                time.sleep(0.3)
        finally:
            program.terminate()
            text, _ = program.communicate(timeout=60)
    assert "real-time factor" in text


def test_mirror_preset_waits_for_its_robot() -> None:
    ended = run(CONFIGS / "sim_mirror.pbtxt", "--duration", "2")
    assert ended.returncode == 0, ended.stderr
    assert "mirror: no message received; start the robot" in ended.stderr


def test_a_twin_follows_a_simulated_robot_of_the_same_domain(tmp_path: Path) -> None:
    with reserved_domain() as domain:
        program = JoshuaProgram(tmp_path, domain, {"DISPLAY": "", "WAYLAND_DISPLAY": ""})
        try:
            robot = program.start("--config", str(CONFIGS / "teleop_so_arm100.pbtxt"), "--sim")
            twin = program("--config", str(CONFIGS / "sim_mirror.pbtxt"), "--duration", "6")
            _, log = program.stop(robot)
        finally:
            program.close()
    assert twin.returncode == 0, twin.stderr + log
    assert "runs without a window: no display" in twin.stderr
    assert re.search(r"mirror: \d+ messages, from arrival to state", twin.stderr), twin.stderr + log
    assert "/twin/joint_states" in twin.stdout
    assert "/clock" not in twin.stdout


def test_offscreen_preset_runs() -> None:
    ended = run(CONFIGS / "sim_offscreen.pbtxt", "--duration", "3")
    assert ended.returncode == 0, ended.stderr
    assert "/camera/top/image_raw" in ended.stdout


def test_passive_preset_replays_its_data_set(tmp_path: Path) -> None:
    path = tmp_path / "sim_passive.pbtxt"
    path.write_text((CONFIGS / "sim_passive.pbtxt").read_text())
    missing = run(path)
    assert missing.returncode == 2
    assert "so_arm100_demos" in missing.stdout + missing.stderr
    assert "joshua-dataset" not in missing.stdout + missing.stderr  # the simulator itself reads it
    root = tmp_path / "datasets" / "so_arm100_demos"
    (root / "meta").mkdir(parents=True)
    (root / "data" / "chunk-000").mkdir(parents=True)
    names = ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper"]
    features = {"observation.state": {"dtype": "float32", "shape": [6], "names": names}}
    info = {"codebase_version": "v3.0", "fps": 30, "features": features}
    (root / "meta" / "info.json").write_text(json.dumps(info))
    states = [[0.01 * n, -1.57, 1.57, 1.57, -1.57, 0.0] for n in range(30)]
    columns = {
        "observation.state": states,
        "timestamp": [n / 30 for n in range(30)],
        "episode_index": [0] * 30,
    }
    pyarrow.parquet.write_table(pyarrow.table(columns), root / "data" / "chunk-000" / "file-000.parquet")
    ended = run(path)
    assert ended.returncode == 0, ended.stderr
    assert "replayed 30 samples of 1 recording(s): within the limits, without a collision" in ended.stderr

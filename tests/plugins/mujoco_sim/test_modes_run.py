"""The four modes as a user starts them: whole runs with real processes and topics."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from joshua.testing.domain import reserved_domain
from sim_configs import simulation_file

CONFIGS = Path(__file__).resolve().parents[3] / "configs"


def run(path: Path, *options: str, environment: dict[str, str] | None = None, timeout_s: float = 60):
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
    assert "limit broken: shoulder_pan at" in ended.stderr
    assert "replayed 60 samples of 1 recording(s)" in ended.stderr


def test_passive_says_what_is_wrong_with_its_file(tmp_path: Path) -> None:
    path = tmp_path / "robot.pbtxt"
    path.write_text(
        'general { mode: MODE_SIMULATION name: "p" id: "passive-test" }\n'
        'simulation { mode: PASSIVE model_path: "so_arm100/scene.xml" trajectory_path: "no.csv" }\n'
    )
    ended = run(path)
    assert ended.returncode != 0
    assert "no.csv does not exist: name a .csv" in ended.stderr


def test_interactive_without_a_screen_says_what_to_do() -> None:
    ended = run(CONFIGS / "sim_interactive.pbtxt", environment={"DISPLAY": "", "WAYLAND_DISPLAY": ""})
    assert ended.returncode != 0
    assert "no screen: neither DISPLAY nor WAYLAND_DISPLAY is set" in ended.stderr
    assert "xvfb-run -a joshua" in ended.stderr


def test_interactive_with_a_screen_that_is_not_there() -> None:
    ended = run(CONFIGS / "sim_interactive.pbtxt", environment={"DISPLAY": ":9999"})
    assert ended.returncode != 0
    assert "the screen :9999 cannot be opened" in ended.stderr


@pytest.fixture
def screen(tmp_path: Path):
    """A virtual screen; its number."""
    if shutil.which("Xvfb") is None:
        pytest.skip("no virtual screen here: sudo apt install xvfb")
    read, write = os.pipe()
    arguments = ["Xvfb", "-displayfd", str(write), "-screen", "0", "1024x768x24", "-fbdir", str(tmp_path)]
    server = subprocess.Popen(arguments, pass_fds=(write,), stderr=subprocess.DEVNULL)
    os.close(write)
    with os.fdopen(read) as pipe:
        number = pipe.readline().strip()
    yield f":{number}"
    server.terminate()
    server.wait()


def test_interactive_shows_the_model_in_a_window(screen: str, tmp_path: Path) -> None:
    def colours() -> int:
        raw = (tmp_path / "Xvfb_screen0").read_bytes()
        return len(np.unique(np.frombuffer(raw[-1024 * 768 * 4 :], np.uint32)))

    with reserved_domain() as domain:
        program = subprocess.Popen(
            [sys.executable, "-m", "joshua.cli.main", "--config", str(CONFIGS / "sim_interactive.pbtxt")],
            env=os.environ | {"ROS_DOMAIN_ID": str(domain), "DISPLAY": screen},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        try:
            end = time.monotonic() + 40
            while colours() < 100:  # an empty screen is black
                assert program.poll() is None, program.communicate()[0]
                assert time.monotonic() < end, "nothing was drawn"
                time.sleep(0.3)
        finally:
            program.terminate()
            text, _ = program.communicate(timeout=30)
    assert "real-time factor" in text

"""The camera preset on an emulated camera: a test run that passes, and ones that do not."""

from __future__ import annotations

import os
import re
import subprocess
import sysconfig
from pathlib import Path

import pytest
from joshua_emulator import EmulatedCamera
from steady_machine import while_steady
from watched import watched_run

JOSHUA = Path(sysconfig.get_path("scripts")) / "joshua"
# A rate that a busy machine holds too.
SLOW = (
    "--set",
    "robot.perceptions[0].camera_config.fps=10",
    "--set",
    "robot.perceptions[0].node.publishers[0].publish_rate_hz=10",
)
PRESET = Path(__file__).parents[2] / "configs" / "test_camera.pbtxt"


def environment(folder: Path, domain_id: int) -> dict[str, str]:
    runtime = folder / "run"
    runtime.mkdir(mode=0o700, exist_ok=True)
    return os.environ | {
        "ROS_DOMAIN_ID": str(domain_id),
        "XDG_RUNTIME_DIR": str(runtime),
        "XDG_STATE_HOME": str(folder / "state"),
        "JOSHUA_LOG_DIR": str(folder / "log"),
    }


def run(folder: Path, domain_id: int, *arguments: str) -> tuple[int, str]:
    done = subprocess.run(
        [str(JOSHUA), "--config", str(PRESET), "--emulate", *SLOW, *arguments],
        capture_output=True,
        text=True,
        timeout=100,
        stdin=subprocess.DEVNULL,
        env=environment(folder, domain_id),
    )
    return done.returncode, done.stdout + done.stderr


@pytest.mark.timing
def test_a_good_camera_passes(tmp_path: Path, joshua_domain_id: int) -> None:
    code, text = while_steady(
        lambda: run(tmp_path, joshua_domain_id, "--duration", "4"), lambda done: done[0] == 0
    )
    assert code == 0, text
    assert re.search(r"/camera: \d+\.\d Hz, \d+ pictures, \d+ dropped", text)  # live figures
    rows = {match[2].strip(): match[1] for match in re.finditer(r"(PASS|FAIL)  /camera  (.{26})", text)}
    assert rows.get("settings kept") == "PASS", text
    assert rows.get("pictures whole") == "PASS", text
    picture = re.search(r"last picture +(\S+\.jpg)", text)
    assert picture is not None
    assert Path(picture[1]).read_bytes().startswith(b"\xff\xd8")


@pytest.mark.timing
def test_a_slow_camera_fails(tmp_path: Path, joshua_domain_id: int) -> None:
    code, text = run(tmp_path, joshua_domain_id, "--duration", "4", "--fault", "camera:rate=5")
    assert code == 1, text
    assert re.search(r"FAIL  /camera  frame rate .* of 10 Hz: many cameras are slower in poor light", text)


@pytest.mark.timing
def test_a_camera_that_is_unplugged_comes_back_and_fails_the_test(
    tmp_path: Path, joshua_domain_id: int
) -> None:
    with EmulatedCamera(fps=10) as camera:
        config = tmp_path / "robot.pbtxt"
        config.write_text(PRESET.read_text().replace("device_id: 0", f'source: "{camera.source}"'))
        command = [str(JOSHUA), "--config", str(config), *SLOW, "--duration", "6"]
        with watched_run(command, environment(tmp_path, joshua_domain_id)) as watched:
            watched.wait("ready after")
            camera.fault("unplug", replug_after_s=0.2)
            code, text = watched.end()
    assert code == 1, text
    assert "disconnected: http://127.0.0.1" in text
    assert "reconnected" in text
    assert re.search(r"FAIL  /camera  connection +lost 1 times", text)


@pytest.mark.parametrize("size", ["800x600"])
def test_a_camera_of_another_size_is_refused(tmp_path: Path, joshua_domain_id: int, size: str) -> None:
    code, text = run(tmp_path, joshua_domain_id, "--duration", "4", "--fault", f"camera:size={size}")
    assert code == 4, text
    assert "delivers 800 × 600, and the file asks for 640 × 480: set width: 800 height: 600" in text

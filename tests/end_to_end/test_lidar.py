"""The laser scanner preset on an emulated scanner: a test run that passes, and ones that do not."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sysconfig
import time
from pathlib import Path

import pytest
from emulators_of_runs import bring_about
from joshua_emulator import EmulatedLidar
from steady_machine import while_steady
from watched import watched_run

JOSHUA = Path(sysconfig.get_path("scripts")) / "joshua"
PRESET = Path(__file__).parents[2] / "configs" / "test_lidar.pbtxt"
BLOCK = "robot.perceptions[0].lidar_config"


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
        [str(JOSHUA), "--config", str(PRESET), *arguments],
        capture_output=True,
        text=True,
        timeout=100,
        stdin=subprocess.DEVNULL,
        env=environment(folder, domain_id),
    )
    return done.returncode, done.stdout + done.stderr


@pytest.mark.timing
def test_a_good_scanner_passes(tmp_path: Path, joshua_domain_id: int) -> None:
    code, text = while_steady(
        lambda: run(tmp_path, joshua_domain_id, "--emulate", "--duration", "5"), lambda done: done[0] == 0
    )
    assert code == 0, text
    rows = {match[2].strip(): match[1] for match in re.finditer(r"(PASS|FAIL)  /lidar  (.{18})", text)}
    assert {"turns", "points of a turn", "beams measured", "packets whole"} <= set(rows), text
    assert set(rows.values()) == {"PASS"}
    assert "RPLIDAR A1, firmware 1.29" in text  # found out, for the preset names no model
    assert re.search(r"/lidar: 5\.\d turns a second, 7\d\d points a turn", text)  # live figures
    assert "seen from above, forward is up" in text
    assert any("⠀" < letter <= "⣿" for letter in text)
    picture = re.search(r"last scan +(\S+\.png)", text)
    assert picture is not None
    assert Path(picture[1]).read_bytes().startswith(b"\x89PNG")


@pytest.mark.timing
def test_a_scanner_that_turns_too_slowly_fails(tmp_path: Path, joshua_domain_id: int) -> None:
    code, text = run(
        tmp_path, joshua_domain_id, "--emulate", "--duration", "4", "--fault", "lidar:turn_hz=2.5"
    )
    assert code == 1, text
    assert re.search(r"FAIL  /lidar  turns +2\.[3-7]\d* a second, usually 5\.5: free its rotor", text)


def test_a_scanner_that_is_unplugged_comes_back_and_fails_the_test(
    tmp_path: Path, joshua_domain_id: int
) -> None:
    command = [str(JOSHUA), "--config", str(PRESET), "--emulate", "--duration", "7"]
    with watched_run(command, environment(tmp_path, joshua_domain_id)) as watched:
        watched.wait("ready after")
        bring_about(watched.text, "lidar", "unplug", replug_after_s=0.5)
        code, text = watched.end()
    assert code == 1, text
    assert re.search(r"disconnected: \S*ttyUSB0 .*the adapter is gone", text) or "the adapter is gone" in text
    assert "reconnected" in text
    assert re.search(r"FAIL  /lidar  connection +lost 1 times", text)


def test_a_wrong_line_speed_is_named_before_anything_runs(tmp_path: Path, joshua_domain_id: int) -> None:
    with EmulatedLidar("ld19") as emulator:
        code, text = run(
            tmp_path,
            joshua_domain_id,
            "--set",
            f'{BLOCK}.comm.serial.port="{emulator.port}"',
            "--duration",
            "4",
        )
    assert code == 4, text
    flat = " ".join(text.split())
    assert (
        "a laser scanner does not answer at 115200 bit/s, but an LD19 does at 230400: set baudrate: 230400"
        in flat
    )


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL], ids=lambda n: n.name)
def test_the_motor_stops_with_the_run(tmp_path: Path, joshua_domain_id: int, number: signal.Signals) -> None:
    with EmulatedLidar("rplidar_a1") as emulator:
        process = subprocess.Popen(
            [str(JOSHUA), "--config", str(PRESET), "--set", f'{BLOCK}.comm.serial.port="{emulator.port}"'],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            stdin=subprocess.DEVNULL,
            env=environment(tmp_path, joshua_domain_id),
        )
        try:
            emulator.wait_for(["motor"], timeout_s=60)
            time.sleep(2)
            deadline_s = time.monotonic() + 60
            while not (emulator.state()["motor"] and emulator.state()["scanning"]):
                assert time.monotonic() < deadline_s
                time.sleep(0.05)
            process.send_signal(number)
            process.wait(60)
            deadline_s = time.monotonic() + 60
            while emulator.state()["motor"] and time.monotonic() < deadline_s:
                time.sleep(0.05)
            assert not emulator.state()["motor"]
            assert not emulator.state()["scanning"]
        finally:
            process.kill()
            process.wait()

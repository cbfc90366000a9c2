"""Presets and files with LEGO SPIKE hubs through the real program, every hub emulated."""

from __future__ import annotations

import os
import re
import signal
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from joshua.testing.program import JoshuaProgram
from joshua_emulator.spike.process import EmulatedHub
from steady_machine import while_steady

CONFIGS = Path(__file__).parents[2] / "configs"
PRESET = str(CONFIGS / "test_spike_ble.pbtxt")


@pytest.mark.timing
def test_the_preset_passes_on_an_emulated_hub(joshua_run: JoshuaProgram) -> None:
    result = while_steady(
        lambda: joshua_run("--config", PRESET, "--emulate", "--duration", "3"),
        lambda done: done.returncode == 0,
    )
    said = result.stdout + result.stderr
    assert result.returncode == 0, said
    assert "emulated: spike_hub at tcp-client:127.0.0.1:" in said
    for check in (
        "rate of /spike/joint_states",
        "rate of /spike/battery",
        "positions",
        "commands on /test/oscillation",
        "tracking error",
    ):
        assert re.search(rf"^PASS +/spike_hub +{check}", said, re.MULTILINE), said


@pytest.mark.timing
def test_a_hub_that_goes_away_comes_back_while_the_rest_runs(joshua_run: JoshuaProgram) -> None:
    rate = re.compile(r"^PASS +/oscillation +rate of /test/oscillation", re.MULTILINE)

    def lose_the_hub() -> tuple[int, str]:
        with EmulatedHub(("A", "B"), name="Pybricks Hub") as hub:
            adapter = f"robot.actions[0].spike_motor_config.comm.ble.adapter={hub.adapter}"
            process = joshua_run.start("--config", PRESET, "--set", adapter, "--duration", "7")
            wait_until(lambda: len(hub.log("track")) > 20)
            hub.fault("out_of_range", replug_after_s=1)
            output, errors = process.communicate(timeout=90)
        return process.returncode, output + errors

    code, said = while_steady(lose_the_hub, lambda done: rate.search(done[1]) is not None)
    assert code == 1, said  # a test does not pass where a node has failed
    assert "the link was lost: the hub was switched off, is out of range" in said
    assert re.search(r"/spike_hub: starts again in 0\.5 s", said)
    assert "restarted after a failure, with torque off" in said or "resume" in said
    assert rate.search(said), said


def test_a_hub_that_is_not_there_is_named_with_the_remedy(joshua_run: JoshuaProgram) -> None:
    result = joshua_run("--config", PRESET, "--emulate", "--fault", "spike_hub:unplug", "--duration", "2")
    said = " ".join((result.stdout + result.stderr).split())
    assert result.returncode == 4, said
    assert "hub 'Pybricks Hub': not found within 8 s; found: nothing" in said
    assert "Switch the hub on and move it closer" in said


@pytest.mark.timing
def test_two_hubs_run_in_one_file(joshua_run: JoshuaProgram, tmp_path: Path) -> None:
    text = Path(PRESET).read_text(encoding="utf-8")
    block = text[text.index("  # The hub's motors.") : text.index("  # The pattern.")]
    second = (
        block.replace("spike_hub", "second_hub")
        .replace("node_id: 1", "node_id: 3")
        .replace("/spike/", "/second/")
        .replace('"Pybricks Hub"', '"Second Hub"')
    )
    path = tmp_path / "two_hubs.pbtxt"
    path.write_text(text.replace("  # The pattern.", second + "  # The pattern."), encoding="utf-8")
    result = while_steady(
        lambda: joshua_run("--config", str(path), "--emulate", "--duration", "3"),
        lambda done: done.returncode == 0,
    )
    said = result.stdout + result.stderr
    assert result.returncode == 0, said
    for node in ("spike_hub", "second_hub"):
        assert re.search(rf"^PASS +/{node} +tracking error", said, re.MULTILINE), said


def test_the_same_hub_twice_is_refused(joshua_run: JoshuaProgram, tmp_path: Path) -> None:
    text = Path(PRESET).read_text(encoding="utf-8")
    block = text[text.index("  # The hub's motors.") : text.index("  # The pattern.")]
    second = block.replace("spike_hub", "second_hub").replace("node_id: 1", "node_id: 3")
    second = second.replace("/spike/", "/second/")
    path = tmp_path / "twice.pbtxt"
    path.write_text(text.replace("  # The pattern.", second + "  # The pattern."), encoding="utf-8")
    result = joshua_run("--config", str(path), "--validate-only")
    assert result.returncode == 2
    assert "ble-device-shared" in result.stdout + result.stderr


def test_the_calibration_preset_runs_whole_and_its_file_is_loaded(
    joshua_run: JoshuaProgram, tmp_path: Path
) -> None:
    joshua_run.environment["XDG_STATE_HOME"] = str(tmp_path / "state")
    result = joshua_run("--config", str(CONFIGS / "calibrate_spike.pbtxt"), "--emulate")
    said = result.stdout + result.stderr
    assert result.returncode == 0, said
    assert "spike_hub: Calibrated." in said
    (written,) = (tmp_path / "state").rglob("calibration/spike-hub.pbtxt")
    text = written.read_text(encoding="utf-8")
    assert re.search(r'device_identity: "ble:F0:AA(:[0-9A-F]{2}){4}"', text)
    (low, high), *_ = re.findall(r"range_min: (\d+)\s+range_max: (\d+)", text)
    assert abs(int(low) - 910) < 30  # the hand goes 100 degrees to both sides
    assert abs(int(high) - 3186) < 30
    checked = joshua_run("calibrate", "--config", PRESET, "--emulate", "--check")
    assert checked.returncode == 0, checked.stdout + checked.stderr


def test_a_killed_run_leaves_motors_without_torque_by_the_hubs_own_switch(joshua_run: JoshuaProgram) -> None:
    with EmulatedHub(("A", "B"), name="Pybricks Hub") as hub:
        adapter = f"robot.actions[0].spike_motor_config.comm.ble.adapter={hub.adapter}"
        release = "robot.actions[0].safe_state=RELEASE"
        process = joshua_run.start("--config", PRESET, "--set", adapter, "--set", release)
        wait_until(lambda: len(hub.log("track")) > 20)
        os.kill(process.pid, signal.SIGKILL)
        wait_until(lambda: not any(motor["powered"] for motor in hub.state()["motors"].values()))
        last = hub.log("track")[-1]["sequence"]
        time.sleep(0.5)
        assert hub.log("track")[-1]["sequence"] == last
        assert hub.state()["running"]  # it was the program's own doing


@pytest.mark.timing
def test_a_search_for_a_hub_ends_when_it_is_told_to(joshua_run: JoshuaProgram) -> None:
    process = joshua_run.start("--config", PRESET, "--emulate", "--fault", "spike_hub:unplug")
    log = joshua_run.folder / "log"
    wait_until(lambda: any("step: configure" in path.read_text() for path in log.glob("*.jsonl")))
    time.sleep(1)
    output, errors = joshua_run.stop(process)
    assert process.returncode == 130, output + errors
    assert "did not notice" not in output + errors  # as it says after 3 s, and the search goes on for 8
    assert "does not advertise" not in output + errors


def wait_until(reached: Callable[[], bool], timeout_s: float = 60.0) -> None:
    end_s = time.monotonic() + timeout_s
    while not reached():
        assert time.monotonic() < end_s, "it did not come about"
        time.sleep(0.02)

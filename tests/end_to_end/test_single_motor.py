"""The preset test_single_motor on an emulated servo: figures, a picture, and torque off in a dry run."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path

import pytest
from joshua.testing.program import JoshuaProgram
from joshua_emulator import EmulatedBus
from steady_machine import while_steady

PRESET = str(Path(__file__).parents[2] / "configs" / "test_single_motor.pbtxt")
SHORT = ("--set", "test.duration_s=4")
PORT = "robot.actions[servo].sts3215_config.comm.serial.port="


def undisturbed(joshua_run: JoshuaProgram, *words: str) -> subprocess.CompletedProcess[str]:
    """A run of the preset; repeated where a busy machine let the emulator or the driver stand still."""
    result = while_steady(
        lambda: joshua_run("--config", PRESET, "--emulate", *SHORT, *words),
        lambda done: done.returncode == 0 and "starts again in" not in done.stderr,
    )
    assert result.returncode == 0, result.stdout + result.stderr
    return result


def measured(output: str, check: str) -> str:
    found = re.search(rf"^PASS  /servo +{check} +(.*)$", output, re.MULTILINE)
    assert found, output
    return found[1]


@pytest.mark.timing
def test_figures_and_a_picture_of_the_motion(joshua_run: JoshuaProgram) -> None:
    result = undisturbed(joshua_run)
    assert re.search(r"0\.0\d+ rad rms, 0\.\d+ rad at most over", measured(result.stdout, "tracking error"))
    lag = re.fullmatch(r"(\d+) ms behind the goal", measured(result.stdout, "lag"))
    assert lag
    assert 5 <= int(lag[1]) <= 300
    assert re.fullmatch(r"\d+% of stall torque at most", measured(result.stdout, "load"))
    assert re.fullmatch(r"2\d(?: to \d+)? °C", measured(result.stdout, "temperature"))
    assert re.search(r"^data: .*-servo\.csv$", result.stdout, re.MULTILINE)
    (picture,) = re.findall(r"^picture: (.*-servo\.png)$", result.stdout, re.MULTILINE)
    assert Path(picture).stat().st_size > 10_000
    assert Path(picture).with_name(Path(picture).name.replace("-servo.png", ".jsonl")).exists()


@pytest.mark.timing
def test_amplitude_and_frequency_are_fields(joshua_run: JoshuaProgram) -> None:
    still = "robot.actions[oscillation].mock_motor_config.motion_amplitude_rad=0.001"
    result = undisturbed(joshua_run, "--set", still)
    assert " lag " not in result.stdout  # what hardly moves has no lag that can be measured


def test_a_dry_run_moves_nothing(joshua_run: JoshuaProgram) -> None:
    with EmulatedBus(ids=(1,)) as servo:
        words = ("--config", PRESET, *SHORT, "--dry-run", "--set", PORT + servo.port)
        result = joshua_run(*words)
        assert servo.servo(1)["energised"] is False
        assert not servo.log("torque")
        goals = [entry for entry in servo.log("write", "sync_write") if goal_was_written(entry)]
        assert goals == [], json.dumps(goals[:3])
        assert servo.servo(1)["present_position"] == 2048
    assert "picture: " in result.stdout
    assert result.returncode == 1, result.stdout  # it does not follow, and the test says so
    assert "FAIL  /servo" in result.stdout


def goal_was_written(entry: dict[str, object]) -> bool:
    """Whether a write reaches the goal position; a write of 1 to torque_enable counts as well."""
    parameters = bytes.fromhex(str(entry["parameters"]))
    first = parameters[0]
    width = parameters[1] if entry["event"] == "sync_write" else len(parameters) - 1
    return first <= 42 < first + width or (first == 40 and 1 in parameters[1:])


def test_a_wrong_supply_voltage_gets_no_torque(joshua_run: JoshuaProgram) -> None:
    with EmulatedBus(ids=(1,)) as servo:
        servo.ask("set", volts=16.0)
        result = joshua_run("--config", PRESET, *SHORT, "--set", PORT + servo.port)
        assert servo.log("torque") == []
    assert result.returncode == 4, result.stdout + result.stderr
    assert "torque stays off: joint_1: 16.0 V, allowed 4.0 to 14.0 V. Remove the cause" in result.stderr


@pytest.mark.parametrize(
    ("fault", "text"), [("over_temperature", "too hot"), ("under_voltage", "V, allowed 4.0 to 14.0 V")]
)
def test_a_trip_ends_the_test_without_torque(joshua_run: JoshuaProgram, fault: str, text: str) -> None:
    with EmulatedBus(ids=(1,)) as servo:
        process = joshua_run.start("--config", PRESET, *SHORT, "--set", PORT + servo.port)
        assert servo.wait_for(["torque"], timeout_s=60)["on"] is True
        servo.fault(fault)
        output, errors = process.communicate(timeout=60)
        assert servo.servo(1)["energised"] is False
    assert process.returncode == 1, output + errors
    assert text in output + errors
    assert "Traceback" not in output + errors

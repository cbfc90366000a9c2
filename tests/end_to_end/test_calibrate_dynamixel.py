"""Calibrating an emulated Koch arm through the program: the procedure is that of every servo bus."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from calibration_run import JOSHUA, CalibrationRun, environment, robot, sweep_all
from joshua_emulator import EmulatedBus


def test_a_koch_arm_is_calibrated_and_found_equal(tmp_path: Path, joshua_domain_id: int) -> None:
    env = environment(tmp_path, joshua_domain_id)
    with EmulatedBus("dynamixel", arm="koch", identity="KOCH1") as arm:
        config = robot(tmp_path, arm.port)
        block = 'dynamixel_config {\n    models: "xl330-m077"\n    '
        config.write_text(config.read_text().replace("sts3215_config {", block))
        with CalibrationRun(["--config", str(config)], env) as run:
            sweep_all(run, arm, lambda: run.press("\n"))
            run.press("\n")
            assert run.end() == 0, run.text[-3000:]
        assert "calibrated: leader_arm." in run.text
        assert not [entry for entry in arm.log("torque") if entry["on"]]
        for motor, servo in zip(arm.calibration()["motors"], arm.servos(), strict=True):
            middle = (motor["range_min"] + motor["range_max"]) / 2
            assert middle == pytest.approx(2048, abs=12), motor
            assert motor["homing_offset"] == -servo["homing_offset"]
        result = subprocess.run(
            [str(JOSHUA), "calibrate", "--check", "--config", str(config)],
            capture_output=True, text=True, timeout=60, stdin=subprocess.DEVNULL, env=env,
        )  # fmt: skip
        assert result.returncode == 0, result.stdout + result.stderr
        assert "EQUAL  leader_arm" in result.stdout

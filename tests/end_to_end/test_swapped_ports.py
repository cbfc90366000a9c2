"""Two emulated arms in each other's port: the remedy keeps both calibrations and works as printed."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from emulated_teleop import PRESET
from google.protobuf import text_format
from joshua.devices.calibration import ArmCalibration
from joshua.schema import config_pb2
from joshua_emulator import EmulatedBus

#: Added to the homing offsets of the second arm, which differs from the first one by nothing else.
DIFFERENCE_TICKS = 12
TRY = "or try it first: "


@pytest.fixture
def arms() -> Iterator[dict[str, EmulatedBus]]:
    """Two calibrated arms, whose adapters have no identity."""
    with (
        EmulatedBus(arm="so_arm100", calibrated=True, identity="") as leader,
        EmulatedBus(arm="so_arm100", calibrated=True, identity="") as follower,
    ):
        for motor in follower.calibration()["motors"]:
            value = motor["homing_offset"] + DIFFERENCE_TICKS
            follower.ask("set_register", id=motor["id"], name="homing_offset", value=value)
        yield {"leader_arm": leader, "follower_arm": follower}


@pytest.fixture
def swapped(tmp_path: Path, arms: dict[str, EmulatedBus]) -> Path:
    """A configuration with the ports of the two arms in each other's place."""
    calibration = config_pb2.Config()
    for name, arm in arms.items():
        entry = ArmCalibration.model_validate(arm.calibration()).to_block(name)
        calibration.calibration.arms.append(entry)
    (tmp_path / "calibration.pbtxt").write_text(text_format.MessageToString(calibration))
    text = PRESET.read_text()
    for former, arm in (("/dev/ttyACM0", arms["follower_arm"]), ("/dev/ttyACM1", arms["leader_arm"])):
        assert f'"{former}"' in text
        text = text.replace(f'"{former}"', f'"{arm.port}"')
    file = tmp_path / "teleop.pbtxt"
    file.write_text('include: "calibration.pbtxt"\n' + text)
    return file


def joshua(folder: Path, domain_id: int, *words: str) -> subprocess.CompletedProcess[str]:
    run = folder / "run"
    run.mkdir(mode=0o700, exist_ok=True)
    environment = {
        **os.environ,
        "ROS_DOMAIN_ID": str(domain_id),
        "XDG_RUNTIME_DIR": str(run),
        "JOSHUA_LOG_DIR": str(folder / "log"),
    }
    return subprocess.run(
        [sys.executable, "-m", "joshua.cli.main", *words],
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
    )


def test_a_run_says_whose_values_they_are_and_its_command_works(
    tmp_path: Path, joshua_domain_id: int, swapped: Path
) -> None:
    refused = joshua(tmp_path, joshua_domain_id, "--config", str(swapped))
    said = refused.stdout + refused.stderr
    assert refused.returncode == 4, said
    assert "these are the values of leader_arm: swap the two ports" in said
    assert "these are the values of follower_arm: swap the two ports" in said
    assert "alibrate again" not in said
    assert refused.stdout.rstrip().splitlines()[-1] == (
        f"this run left no torque on; to check its devices: joshua doctor {swapped}"
    )
    (command, *_) = [line.partition(TRY)[2] for line in said.splitlines() if TRY in line]
    good = joshua(tmp_path, joshua_domain_id, *shlex.split(command)[1:], "--duration", "0.5")
    assert good.returncode == 0, good.stdout + good.stderr


@pytest.mark.parametrize(
    "words", [("calibrate", "--check", "--config"), ("doctor",)], ids=["check", "doctor"]
)
def test_the_other_commands_say_the_same(
    tmp_path: Path, joshua_domain_id: int, swapped: Path, words: tuple[str, ...]
) -> None:
    found = joshua(tmp_path, joshua_domain_id, *words, str(swapped))
    said = found.stdout + found.stderr
    assert found.returncode != 0
    assert "these are the values of leader_arm: swap the two ports" in said, said
    assert "Both calibrations are good: keep them." in said
    assert "alibrate the arm again" not in said

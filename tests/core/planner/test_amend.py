"""What stands in for devices: shown in a plan without being started, and refused where it cannot."""

from __future__ import annotations

from pathlib import Path

import pytest
from joshua.cli.main import main
from joshua.config import load
from joshua.planner.amend import without_emulator
from joshua.plugins import PluginRow, PluginStatus, Registry

FILE = """
general { mode: MODE_TELEOPERATE id: "r" name: "r" }
robot {
  actions { node { node_name: "left" } action_type: ACTION_LEADER sts3215_config { motor_ids: 1 } }
  actions { node { node_name: "right" } action_type: ACTION_SINGLE sts3215_config { motor_ids: 1 } }
}
"""


@pytest.fixture(autouse=True)
def _from_a_package(monkeypatch: pytest.MonkeyPatch) -> None:
    """The core is installed from a package, so that plugins are named by their distribution."""
    monkeypatch.setattr("joshua.plan.installing.clone", lambda: None)
    monkeypatch.setattr("joshua.plan.installing.origin", lambda *_: "")


@pytest.mark.parametrize(
    ("status", "remedy"),
    [
        (None, "pip install joshua-emulator, or leave the device out of the file."),
        (PluginStatus.BLOCKED, "Leave --block-plugin emulator out, or leave the device out of the file."),
        (PluginStatus.BROKEN, "Look up joshua-emulator in `joshua plugins`, or leave the device out"),
        (
            PluginStatus.OK,
            "Leave the device out of the file, or ask its vendor for a plugin with an emulator.",
        ),
    ],
)
def test_devices_that_nothing_emulates(tmp_path: Path, status: PluginStatus | None, remedy: str) -> None:
    path = tmp_path / "robot.pbtxt"
    path.write_text(FILE)
    loaded = load(str(path))
    row = PluginRow("emulator", "joshua-emulator", "1", status=status) if status else None
    (finding,) = without_emulator(loaded, Registry((row,) if row else ()))
    assert finding.message.startswith("left, right: no plugin in use emulates sts3215_config, and --emulate")
    assert finding.remedy.startswith(remedy)
    assert finding.position is not None
    assert finding.position.line == 4
    assert [place.label for place in finding.related] == ["right needs it too"]


CONFIGS = Path(__file__).resolve().parents[3] / "configs"


def joshua(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str]:
    code = main([*words, "--config", str(CONFIGS / "teleop_so_arm100_camera.pbtxt")])
    shown = capsys.readouterr()
    return code, shown.out + shown.err


def test_a_plan_shows_emulated_endpoints_and_starts_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("joshua_emulator")
    code, shown = joshua(capsys, "plan", "--emulate")
    assert code == 0, shown
    assert shown.count("port = emulated") == 2
    assert "/dev/tty" not in shown
    assert "http://emulated" in shown


def test_a_plan_shows_simulated_devices(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("joshua_mujoco_sim")
    code, shown = joshua(capsys, "plan", "--sim")
    assert code == 0, shown
    assert "joshua_mujoco_sim.actuator:SimActuator" in shown
    assert "joshua_mujoco_sim.camera:SimCamera" in shown
    assert "sts3215" not in shown


def test_validation_takes_both(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("joshua_mujoco_sim")
    pytest.importorskip("joshua_emulator")
    assert joshua(capsys, "--validate-only", "--sim", "--emulate")[0] == 0
    code, shown = joshua(capsys, "--validate-only", "--sim", "--block-plugin", "mujoco-sim")
    assert code == 2
    assert "--sim requires the plugin joshua-mujoco-sim, which is not installed" in " ".join(shown.split())


def test_devices_that_a_simulated_run_opens_all_the_same_are_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("joshua_mujoco_sim")
    pytest.importorskip("joshua_lidar")
    lidar = """robot { perceptions { node { node_name: "lidar_front" node_id: 9
    publishers { data_type: LASER_SCAN topic_name: "/scan" publish_rate_hz: 10 } }
    perception_type: PERCEPTION_LIDAR
    lidar_config { comm { serial { port: "/dev/ttyUSB0" baudrate: 115200 } }
      angle_max: 3.14 range_min: 0.1 range_max: 12 } }"""
    text = (CONFIGS / "teleop_so_arm100.pbtxt").read_text(encoding="utf-8")
    path = tmp_path / "robot.pbtxt"
    path.write_text(text.replace("robot {", lidar, 1), encoding="utf-8")
    assert main(["plan", "--sim", "--config", str(path)]) == 0
    shown = " ".join(capsys.readouterr().err.split())
    assert "--sim does not replace these devices, and the run opens them: lidar_front." in shown

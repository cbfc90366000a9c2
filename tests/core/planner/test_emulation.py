"""Devices that nothing emulates: one finding for all of a kind, with what helps."""

from __future__ import annotations

from pathlib import Path

import pytest
from joshua.config import load
from joshua.planner.emulation import EmulatedRig
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


@pytest.mark.parametrize(
    ("status", "remedy"),
    [
        (None, "pip install joshua-emulator, or leave the device out of the file."),
        (PluginStatus.BLOCKED, "Leave --block-plugin emulator out, or leave the device out of the file."),
        (PluginStatus.BROKEN, "See what `joshua plugins` says of joshua-emulator, or leave the device out"),
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
    row = PluginRow("emulator", "joshua-emulator", "1", status) if status else None
    rig = EmulatedRig(loaded.config, Registry((row,) if row else ()), {})
    (finding,) = rig.problems(loaded.positions)
    assert finding.message.startswith("left, right: no plugin in use emulates sts3215_config, and --emulate")
    assert finding.remedy.startswith(remedy)
    assert finding.position is not None
    assert finding.position.line == 4
    assert [place.label for place in finding.related] == ["right needs it too"]

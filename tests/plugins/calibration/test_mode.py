"""What MODE_CALIBRATION asks of a file, and what counts in it."""

from __future__ import annotations

from pathlib import Path

import pytest
from joshua.config import check, load
from joshua.config.diagnostics import render_text
from joshua.modes import check_mode, mode_of
from joshua.planner.pipeline import check_file
from joshua.planner.request import Request
from joshua.plugins import load_registry

BAD = Path(__file__).parent / "bad"
ARM = """robot { actions { node { node_name: "a" node_id: 1 } action_type: ACTION_SINGLE
  sts3215_config { motor_ids: 1 position_max: 1 } } }"""


def test_what_is_said_about_a_file_that_has_nothing_to_calibrate(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(BAD)
    loaded = load("calibration_mode.pbtxt")
    found = [*loaded.diagnostics, *check(loaded), *check_mode(loaded, load_registry())]
    assert render_text(found, loaded.sources) == (BAD / "calibration_mode.expected").read_text(
        encoding="utf-8"
    )


@pytest.mark.parametrize("more", ["", 'include: "calibration/x.pbtxt"'])
def test_a_calibration_run_neither_loads_nor_checks_the_old_calibration(more: str, tmp_path: Path) -> None:
    arm = 'calibration { arms { node_name: "a" motors { id: 9 joint_name: "of another arm" } } }'
    (tmp_path / "calibration").mkdir()
    (tmp_path / "calibration" / "x.pbtxt").write_text(arm, encoding="utf-8")
    path = tmp_path / "robot.pbtxt"
    for mode, expected in (("MODE_TEST", True), ("MODE_CALIBRATION", False)):
        path.write_text(f'{more} general {{ mode: {mode} id: "x" }} {ARM}', encoding="utf-8")
        checked = check_file(Request(str(path)))
        found = {item.code for item in checked.diagnostics}
        assert ("calibration-unknown-motor" in found) is expected
        assert checked.loaded.config.HasField("calibration") is (expected or bool(more))


@pytest.mark.parametrize(
    "block", ["calibration_run { }", 'simulation { mode: OFFSCREEN model_path: "x.xml" }']
)
def test_blocks_that_count(block: str, tmp_path: Path) -> None:
    path = tmp_path / "robot.pbtxt"
    path.write_text(f'general {{ mode: MODE_CALIBRATION id: "x" }} {ARM} {block}', encoding="utf-8")
    loaded = load(path)
    assert check_mode(loaded, load_registry()) == []
    assert mode_of(loaded.config, load_registry()).run == "joshua_calibration.run:run_calibration"

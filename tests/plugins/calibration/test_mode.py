"""What MODE_CALIBRATION asks of a file, and what counts in it."""

from __future__ import annotations

from pathlib import Path

import pytest
from joshua.config import check, load
from joshua.config.diagnostics import render_text
from joshua.modes import check_mode, mode_of
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


@pytest.mark.parametrize(
    "block", ["calibration_run { }", 'simulation { mode: OFFSCREEN model_path: "x.xml" }']
)
def test_blocks_that_count(block: str, tmp_path: Path) -> None:
    path = tmp_path / "robot.pbtxt"
    path.write_text(f'general {{ mode: MODE_CALIBRATION id: "x" }} {ARM} {block}', encoding="utf-8")
    loaded = load(path)
    assert check_mode(loaded, load_registry()) == []
    assert mode_of(loaded.config, load_registry()).run == "joshua_calibration.run:run_calibration"

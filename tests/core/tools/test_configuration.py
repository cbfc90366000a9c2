"""Checking, planning and explaining as functions, for editors and scripts."""

from __future__ import annotations

import itertools
import subprocess
import sys

import joshua.tools
import pytest
from joshua.cli.presets import FOLDER
from joshua.tools import PipelineResult, check, explain, plan, spans

PRESET = str(FOLDER / "test_mock_hardware.pbtxt")


def test_a_file_is_checked_and_planned():
    assert check(PRESET).errors == []
    assert check(PRESET).plan is None
    found: PipelineResult = plan(PRESET, overrides=["general.mode=MODE_TEST"])
    assert found.plan is not None
    assert found.plan.mode == "MODE_TEST"
    assert {item.code for item in check(PRESET, overrides=["general.mod=MODE_TEST"]).errors} == {
        "unknown-field"
    }


def test_a_field_is_explained_and_a_wrong_name_gets_the_nearest():
    assert "general" in explain()
    assert "MODE_TEST" in explain("MODE_TEST")
    with pytest.raises(LookupError, match="nothing is named 'MODE_TESTT'\n  nearest: "):
        explain("MODE_TESTT")


def test_spans_say_where_values_stand():
    text = 'calibration { arms { node_name: "a" } # one\n arms: [{ node_name: "b" }, { }] }'
    assert [text[start:end] for start, end in spans(text, "calibration.arms.node_name")] == ['"a"', '"b"']
    arms = [text[start:end] for start, end in spans(text, "calibration.arms")]
    assert arms == ['{ node_name: "a" }', '{ node_name: "b" }', "{ }"]
    assert spans(text, "general.id") == []
    with pytest.raises(ValueError, match="The block general is not closed"):
        spans("general {", "general.id")


def test_every_name_can_be_had_and_none_is_loaded_before():
    for modules in joshua.tools.SECTIONS.values():
        for name in itertools.chain(*modules.values()):
            assert getattr(joshua.tools, name) is not None
    listed = [module for modules in joshua.tools.SECTIONS.values() for module in modules]
    assert len(set(listed)) == len(listed), "a module under two headings hides its first names"
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        joshua.tools.nothing  # type: ignore[attr-defined]  # noqa: B018
    loaded = subprocess.run(
        [sys.executable, "-c", "import sys, joshua.tools; print(*sys.modules)"],
        capture_output=True,
        text=True,
        check=True,
    ).stdout.split()
    rooms = {name.split(".")[1] for name in loaded if name.startswith("joshua.")}
    assert rooms == {"plan", "tools"}
    assert not {"pydantic", "numpy", "google.protobuf"} & set(loaded)

"""The messages that the diagnostics page shows."""

from __future__ import annotations

from joshua.config.codes import CODES
from reference.diagnostics import diagnostics_page
from reference.finding_examples import example_messages


def test_most_codes_have_a_message():
    examples = example_messages()
    assert set(examples) <= set(CODES)
    assert len(examples) > 100
    assert examples["camera-shared"] == (
        "`error: camera_top and camera_wrist use the same camera; only one node can open a camera.`"
    )


def test_messages_of_several_lines_are_joined():
    for text in example_messages().values():
        assert "\n" not in text
        assert text.strip("`").startswith(("error: ", "warning: ", "note: "))


def test_the_page_shows_the_json_form():
    page = diagnostics_page()
    assert "## Findings as JSON" in page
    for field in ("code", "severity", "message", "end_column", "field_path", "allowed", "remedy", "related"):
        assert f"`{field}`" in page

from __future__ import annotations

import re
from typing import Any

import pytest
from joshua.cli.table import COMMANDS
from joshua.config.codes import CODES
from joshua.schema import config_pb2, data_type_pb2
from reference import changelog, configuration
from reference.changelog import changelog_page
from reference.command_line import BROUGHT, command_line_page
from reference.configuration import configuration_page, enums_of, reachable
from reference.data_types import data_types_page
from reference.diagnostics import diagnostics_page
from reference.markdown import EXTENSION, cell, table
from reference.presets import presets_page

PAGE = configuration_page()
MESSAGES = list(reachable(config_pb2.Config.DESCRIPTOR))


def section(name: str) -> str:
    """Text of the section of a message or enum."""
    match = re.search(rf"^## {name}\b.*?(?=^#|\Z)", PAGE, re.DOTALL | re.MULTILINE)
    assert match is not None, f"the page has no section {name}"
    return match.group()


@pytest.mark.parametrize("message", MESSAGES, ids=lambda message: message.name)
def test_every_field_has_a_row_with_its_meaning(message: Any):
    text = section(message.name)
    for field in message.fields:
        (row,) = re.findall(rf"^\| (?:\*\*)?`{field.name}`.*$", text, re.MULTILINE)
        cells = [part.strip() for part in row.split(" | ")]
        assert cells[1]
        assert cells[2], f"{field.full_name} has no comment"
        marked = EXTENSION in cells[0]
        assert marked == (field.number >= 100 or message.name == "Calibration"), field.full_name


def test_every_value_of_every_enum_has_a_row():
    for enum in enums_of(MESSAGES):
        if enum.full_name in configuration.ELSEWHERE:
            continue
        text = section(enum.name)
        for value in enum.values:
            if value.name.endswith("_UNSPECIFIED"):
                continue
            (row,) = re.findall(rf"^\| `{value.name}`.*$", text, re.MULTILINE)
            assert (EXTENSION in row) == (value.number >= 100)


def test_a_row_says_unit_range_default_and_link():
    assert (
        "| `position_max` | integer | Largest position that is commanded. "
        "| 0 to 4095 ticks | such as `4095` |" in section("STS3215Config").replace("**", "")
    )
    rows = section("SingleAction")
    assert "[STS3215Config](#sts3215config)" in rows
    assert "excludes the other blocks of `actuator_config`" in rows
    assert "Stands at `robot.actions[]`." in rows


def test_blocks_that_only_extensions_reach_are_marked():
    assert EXTENSION in section("MockCameraConfig").splitlines()[0]
    assert EXTENSION not in section("CameraConfig").splitlines()[0]
    assert EXTENSION not in section("Calibration").splitlines()[0]


def test_every_link_within_the_page_has_its_target():
    targets = set(re.findall(r"\{ #(\w+) \}", PAGE))
    assert set(re.findall(r"\]\(#(\w+)\)", PAGE)) <= targets


def test_every_message_type_has_a_row():
    page = data_types_page()
    for value in data_type_pb2.DataType.DESCRIPTOR.values:
        if value.number:
            assert f"| `{value.name}` |" in page
    assert "| `JOINT_STATE` | `sensor_msgs/msg/JointState` |" in page


def test_every_diagnostic_has_a_row():
    page = diagnostics_page()
    for name, document in CODES.items():
        assert f'<code id="{name}">' in page
        assert cell(document.next_step) in page


def test_every_command_and_its_options_are_listed():
    page = command_line_page()
    for name in (*(command.name for command in COMMANDS), *BROUGHT):
        assert f"\n## joshua {name}\n" in page
    assert "| `--validate-only` | Check the file and start nothing. |" in page
    assert "| `--from PRESET` | The preset to copy. |" in page
    assert "| 130 | interrupted before the start |" in page


def test_presets_are_listed_with_what_they_need():
    page = presets_page()
    assert "### teleop_dual_arm\n" in page
    assert "- Plugins: joshua-sts3215\n" in page


def test_cells_keep_their_text_as_it_is():
    assert cell(" a | b\n c ") == "a \\| b c"
    assert cell(r"write \0 as `\0`") == r"write \\0 as `\0`"


def test_a_column_without_content_is_left_out():
    assert table(("A", "B", "C"), [("1", "", "2")]) == ["| A | C |", "|---|---|", "| 1 | 2 |", ""]


def test_the_changelog_page_shows_what_is_unreleased_before_the_past(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(changelog, "unreleased", lambda: "## Unreleased\n\n### Added\n\n- A thing.\n")
    page = changelog_page()
    assert page.startswith("# Changelog\n")
    assert page.index("- A thing.") < page.index("## Development up to November 2026")


def test_each_fragment_is_in_the_draft_under_its_kind():
    draft = changelog.unreleased()
    for fragment in (changelog.ROOT / "changes").glob("*.*.md"):
        first = fragment.read_text(encoding="utf-8").split()[:3]
        assert " ".join(first) in " ".join(draft.split()), fragment.name
        assert f"### {fragment.name.split('.')[1].capitalize()}\n" in draft

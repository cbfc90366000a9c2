"""Includes: merging, order, and the errors that name the places."""

from __future__ import annotations

from pathlib import Path

import pytest
from joshua.config import LoadedConfig, load
from joshua.plan import Diagnostic


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write(**files: str) -> None:
    for name, text in files.items():
        path = Path(name.replace("__", "/") + ".pbtxt")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


def codes(loaded: LoadedConfig) -> list[str]:
    return [item.code for item in loaded.diagnostics]


def only(loaded: LoadedConfig) -> Diagnostic:
    assert len(loaded.diagnostics) == 1, loaded.diagnostics
    return loaded.diagnostics[0]


def test_files_merge_as_if_their_text_stood_at_the_include() -> None:
    write(
        robot='robot { actions { action_type: ACTION_LEADER } }\ninclude: ["parts/a.pbtxt", "b.pbtxt"]\n'
        "robot_is_not_here: 1",
        parts__a="robot { actions { action_type: ACTION_FOLLOWER } } include: 'deep/c.pbtxt'",
        parts__deep__c='general { name: "c" } robot { actions { action_type: ACTION_SINGLE } }',
        b='general { id: "b" } robot { actions { action_type: ACTION_MOCK } }',
    )
    loaded = load("robot.pbtxt")
    assert codes(loaded) == ["unknown-field"]
    assert [action.action_type for action in loaded.config.robot.actions] == [1, 2, 3, 4]
    assert (loaded.config.general.name, loaded.config.general.id) == ("c", "b")
    assert list(loaded.sources) == ["robot.pbtxt", "parts/a.pbtxt", "parts/deep/c.pbtxt", "b.pbtxt"]
    assert list(loaded.config.include) == ["parts/a.pbtxt", "deep/c.pbtxt", "b.pbtxt"]
    places = [str(loaded.positions.name(f"robot.actions[{index}].action_type")) for index in range(4)]
    assert places == ["robot.pbtxt:1:19", "parts/a.pbtxt:1:19", "parts/deep/c.pbtxt:1:41", "b.pbtxt:1:39"]


def test_a_missing_include_is_an_error_at_its_line() -> None:
    write(robot='general { }\ninclude: "calibration/arm_01.pbtxt"\n', calibration__arm_001="")
    found = only(load("robot.pbtxt"))
    assert (found.code, str(found.position), found.field_path) == (
        "include-missing", "robot.pbtxt:2:10", "include",
    )  # fmt: skip
    assert found.message == "There is no file calibration/arm_01.pbtxt to include."
    assert found.allowed == ("calibration/arm_001.pbtxt",)


def test_an_empty_include_is_an_error() -> None:
    write(robot='include: ""')
    assert only(load("robot.pbtxt")).message == "The path of the included file is empty."


def test_a_folder_cannot_be_included() -> None:
    write(robot='include: "."')
    assert only(load("robot.pbtxt")).code == "not-a-file"


def test_a_cycle_names_the_chain() -> None:
    write(robot='include: "a.pbtxt"', a="\n  include: 'b.pbtxt'", b='include: "a.pbtxt"')
    found = only(load("robot.pbtxt"))
    assert (found.code, str(found.position)) == ("include-cycle", "b.pbtxt:1:10")
    assert found.message == "The file includes itself: a.pbtxt → b.pbtxt → a.pbtxt."


def test_a_file_that_includes_itself_by_another_name_is_a_cycle(folder: Path) -> None:
    write(robot='include: "link.pbtxt"')
    (folder / "link.pbtxt").symlink_to(folder / "robot.pbtxt")
    assert only(load("robot.pbtxt")).message == "The file includes itself: robot.pbtxt → link.pbtxt."


def test_a_file_included_by_two_routes_names_both_places() -> None:
    write(
        robot='include: "a.pbtxt"\ninclude: "b.pbtxt"',
        a='include: "c.pbtxt"',
        b='\ninclude: "./c.pbtxt"',
        c="robot { actions { } }",
    )
    loaded = load("robot.pbtxt")
    found = only(loaded)
    assert (found.code, str(found.position)) == ("include-twice", "b.pbtxt:2:10")
    assert found.message == "c.pbtxt is included already; its content would be added twice."
    assert [(str(item.position), item.label) for item in found.related] == [
        ("a.pbtxt:1:10", "it is included first here")
    ]
    assert len(loaded.config.robot.actions) == 1


def test_a_scalar_set_in_two_files_names_both_places() -> None:
    write(robot='include: "a.pbtxt"\ngeneral { name: "x" id: "y" }', a='general {\n  name: "z" }')
    loaded = load("robot.pbtxt")
    found = only(loaded)
    assert (found.code, str(found.position), found.field_path) == (
        "set-in-two-files", "robot.pbtxt:2:11", "general.name",
    )  # fmt: skip
    assert found.message == "name is also set in a.pbtxt."
    assert str(found.related[0].position) == "a.pbtxt:2:3"
    assert loaded.config.general.id == "y"


def test_zero_counts_as_set_in_two_files() -> None:
    write(robot='include: "a.pbtxt"\ntransport { domain_id: 0 }', a="transport { domain_id: 0 }")
    assert codes(load("robot.pbtxt")) == ["set-in-two-files"]


def test_a_oneof_split_over_two_files_is_a_conflict() -> None:
    write(
        robot='include: "a.pbtxt"\nai { data_store { plugin_config { } } }',
        a="ai { data_store { plugin_config { } } }",
    )
    assert codes(load("robot.pbtxt")) == ["set-in-two-files"]


def test_a_block_written_twice_in_one_file_stays_an_error_beside_includes() -> None:
    write(robot='include: "a.pbtxt"\ngeneral { id: "x" }\ngeneral { mode: 77 }', a='general { name: "z" }')
    loaded = load("robot.pbtxt")
    assert [(item.code, item.position and item.position.line) for item in loaded.diagnostics] == [
        ("duplicate-field", 3),
        ("unknown-enum-number", 3),
    ]


def test_problems_come_file_by_file_and_from_top_to_bottom() -> None:
    write(
        robot='general { a: 1 }\ninclude: "a.pbtxt"\nrobot { b: 1 } c: 1\nmode TEST',
        a="d: 1\ne: 1",
    )
    places = [str(item.position) for item in load("robot.pbtxt").diagnostics]
    assert places == [
        "robot.pbtxt:1:11",
        "robot.pbtxt:3:9",
        "robot.pbtxt:3:16",
        "robot.pbtxt:4:1",
        "robot.pbtxt:4:1",
        "a.pbtxt:1:1",
        "a.pbtxt:2:1",
    ]


def test_too_many_files_are_refused() -> None:
    names = [f"f{number}" for number in range(300)]
    write(
        robot="include: [" + ", ".join(f'"{name}.pbtxt"' for name in names) + "]", **dict.fromkeys(names, "")
    )
    loaded = load("robot.pbtxt")
    assert set(codes(loaded)) == {"too-many-files"}
    assert len(loaded.sources) == 256


def test_a_chain_of_includes_has_an_end(folder: Path) -> None:
    for number in range(200):
        Path(f"{number:03}.pbtxt").write_text(f'include: "{number + 1:03}.pbtxt"\n', encoding="utf-8")
    Path("200.pbtxt").write_text("general { }\n", encoding="utf-8")
    found = only(load("000.pbtxt"))
    assert (found.code, str(found.position)) == ("include-too-deep", "032.pbtxt:1:10")
    assert found.message == "A chain of includes has more than 32 files."


def test_an_absolute_include_is_taken_as_it_stands(folder: Path) -> None:
    write(robot=f'include: "{folder}/sub/a.pbtxt"', sub__a='general { name: "a" }')
    loaded = load("robot.pbtxt")
    assert codes(loaded) == []
    assert str(loaded.positions.value("general.name")) == f"{folder}/sub/a.pbtxt:1:17"


def test_an_include_may_begin_at_the_home_folder(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(folder / "home"))
    write(robot='include: "~/arm.pbtxt" include: "~nobody-of-this-name/arm.pbtxt"', home__arm="general { }")
    assert only(load("robot.pbtxt")).found == "~nobody-of-this-name/arm.pbtxt"
    assert str(folder / "home" / "arm.pbtxt") in load("robot.pbtxt").sources

"""Recovery: where each syntax error is reported, and that what stands around it is still read."""

from __future__ import annotations

from pathlib import Path

import pytest
from joshua.config import LoadedConfig, load
from joshua.textproto.limits import MAX_DEPTH
from third_party import PACKAGE, URL, sample_class


def read(folder: Path, text: str) -> LoadedConfig:
    path = folder / "robot.pbtxt"
    path.write_text(text, encoding="utf-8")
    return load(path, message_types=[sample_class()])


def places(loaded: LoadedConfig) -> list[str]:
    """Code, line and column of each finding."""
    return [
        f"{item.code} {item.position.line}:{item.position.column}" if item.position else item.code
        for item in loaded.diagnostics
    ]


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("general { mode = MODE_TEST }", ["missing-colon 1:16"]),
        ("general { mode MODE_TEST }", ["missing-colon 1:11"]),
        ('general { name "x" }', ["missing-colon 1:11"]),
        ("general { mode: }", ["missing-value 1:11"]),
        ("general { mode:\n name: 'x' }", ["missing-value 1:11"]),
        ("general", ["missing-value 1:1"]),
        ("general:", ["missing-value 1:1"]),
        ("general\n  name: 'x'\n", ["missing-brace 1:1"]),
        ("general:\n  name: 'x'\nrobot {}\n", ["missing-brace 1:1"]),
        ("general { name: x y }", ["wrong-type 1:17", "unexpected-text 1:19"]),
        ("general { name: 'x' 'y' z }", ["unexpected-text 1:25"]),
        ("general { name: /dev/tty0 id: 'x' }", ["unquoted-string 1:17"]),
        ("general { name: a.b.c id: 'x' }", ["unquoted-string 1:17"]),
        ("general { name: “a b” id: 'x' }", ["unquoted-string 1:17"]),
        ("general { name: 'x\n id: 'y' }", ["unclosed-string 1:17"]),
        ("general { name: 'a' 'x\n id: 'y' }", ["unclosed-string 1:21"]),
        ("general { name: 'x\\", ["unclosed-block 1:9", "unclosed-string 1:17"]),
        ("general { , name: 'x' }", ["unexpected-text 1:11"]),
        ("general { name: 'x',, id: 'y' }", ["unexpected-text 1:21"]),
        ("general { // x\n name: 'x' }", ["unexpected-text 1:11"]),
        ("general { @ { name: 'x' } id: 'y' }", ["unexpected-text 1:11"]),
        ("general { name: 'x' > id: 'y' }",
         ["mismatched-closer 1:21", "unknown-field 1:23", "stray-closer 1:31"]),
        ("general < name: 'x' }", ["mismatched-closer 1:21"]),
        ("general { name: 'x'", ["unclosed-block 1:9"]),
        ("general { name: 'x' } }", ["stray-closer 1:23"]),
        ("general { 5 }", ["unexpected-text 1:11"]),
        ("general { 1: 5 }", ["unknown-field 1:11"]),
        ("robot { actions [ {}, ] }", ["extra-comma 1:21"]),
        ("robot { actions [ {} {} ] }", ["missing-comma 1:21"]),
        ("robot { actions [ {}; {} ] }", ["missing-comma 1:21"]),
        ("robot { actions [ , {} ] }", ["extra-comma 1:19"]),
        ("robot { actions [ [ {} ] }", ["unexpected-text 1:19"]),
        ("robot { actions [ {}\n  perceptions: {} }", ["unclosed-list 1:17"]),
        ("robot { actions [ {}", ["unclosed-block 1:7", "unclosed-list 1:17"]),
        ("include ['x']", ["missing-colon 1:1", "include-missing 1:10"]),
        ("robot { actions: 5 perceptions: [5] }", ["wrong-type 1:18", "wrong-type 1:34"]),
        ("general: [5]", ["wrong-type 1:10"]),
        ("general { name { } id: { } }", ["wrong-type 1:16", "wrong-type 1:24"]),
        ("general { [acme.x/Y]: 1 }", ["extension-field 1:11"]),
        ("general { [acme.x/Y }", ["bad-type-name 1:11"]),
        ("general { name: '\\q\\777\\ud800' }", ["bad-escape 1:18"]),
        ("general { name: '\\xff' }", ["not-utf8-string 1:17"]),
        ("general { name: 'a' name: 'b' }", ["duplicate-field 1:21"]),
        ("general { } general { id: 5 }", ["duplicate-field 1:13", "wrong-type 1:27"]),
        ("robot { actions { sim_config {} sts3215_config { x: 1 } } }",
         ["oneof-conflict 1:33", "unknown-field 1:50"]),
        ("transport { domain_id: 99999999999 kind: 7 }",
         ["number-out-of-range 1:24", "unknown-enum-number 1:42"]),
        ("transport { kind: 4294967296 }", ["unknown-enum-number 1:19"]),
        ("transport { domain_id: 1.5 kind: ZENOH }", ["wrong-type 1:24", "unknown-enum-value 1:34"]),
        ("simulation { plugin_config { [acme/] {} } }", ["bad-type-name 1:30"]),
        ("simulation { plugin_config { [/acme.T] {} } }", ["bad-type-name 1:30"]),
        ("simulation { plugin_config { [a%zz.b/acme.T] {} } }", ["bad-type-name 1:30"]),
        ("simulation { plugin_config { [a.b/9.T] {} } }", ["bad-type-name 1:30"]),
        (f"simulation {{ plugin_config {{ [{URL}] {{}}, }} }}", ["unexpected-text 1:75"]),
        (f"simulation {{ plugin_config {{ [{URL}] {{}} [{URL}] {{}} }} }}", ["mixed-any 1:76"]),
        (f"simulation {{ plugin_config {{ [{URL}]: 5 }} }}", ["wrong-type 1:74"]),
        (f"simulation {{ plugin_config {{ [{URL}] {{ f_int: 1 }} }} }}", ["unknown-field 1:75"]),
        ("simulation { plugin_config { type_url: 5 } }", ["wrong-type 1:40"]),
    ],
)  # fmt: skip
def test_each_error_has_its_place(tmp_path: Path, text: str, wanted: list[str]) -> None:
    loaded = read(tmp_path, text)
    assert places(loaded) == wanted
    assert all(item.remedy and item.message.endswith(".") for item in loaded.diagnostics)


def test_a_missing_closing_brace_is_found_by_the_indentation(tmp_path: Path) -> None:
    loaded = read(
        tmp_path,
        "robot {\n"
        "  actions {\n"
        "    node {\n"
        '      node_name: "a"\n'
        "    action_type: ACTION_LEADER\n"
        "  }\n"
        "  actions {\n"
        '    node { node_name: "b" }\n'
        "  }\n"
        "}\n",
    )
    assert places(loaded) == ["unclosed-block 3:10"]
    names = [action.node.node_name for action in loaded.config.robot.actions]
    assert names == ["a", "b"]
    assert loaded.config.robot.actions[0].action_type == 1


def test_two_missing_braces_at_once(tmp_path: Path) -> None:
    loaded = read(tmp_path, "robot {\n  actions {\n    node {\n      node_id: 1\ngeneral {\n  name: 'x'\n}\n")
    assert places(loaded) == ["unclosed-block 1:7", "unclosed-block 2:11", "unclosed-block 3:10"]
    assert loaded.config.general.name == "x"


def test_a_surplus_brace_is_found_by_the_indentation(tmp_path: Path) -> None:
    loaded = read(
        tmp_path,
        "robot {\n  actions {\n    node {\n      node_id: 1\n    }\n    }\n"
        "    action_type: ACTION_LEADER\n  }\n}\n",
    )
    assert places(loaded) == ["stray-closer 6:5"]
    assert loaded.config.robot.actions[0].action_type == 1


def test_a_file_without_indentation_is_read_by_its_braces(tmp_path: Path) -> None:
    loaded = read(tmp_path, "general {\nname: 'x'\n}\nrobot {\nactions {\n}\n")
    assert places(loaded) == ["unclosed-block 4:7"]
    assert loaded.config.general.name == "x"
    assert len(loaded.config.robot.actions) == 1


def test_odd_indentation_alone_is_no_error(tmp_path: Path) -> None:
    loaded = read(tmp_path, "general {\n name: 'x'\n      }\nrobot {\nactions {\n    }\n  }\n")
    assert loaded.diagnostics == []


def test_blocks_deeper_than_the_limit_give_one_error(tmp_path: Path) -> None:
    depth = MAX_DEPTH + 50
    body = f"{'inner { ' * depth}{'} ' * depth}"
    text = f"simulation {{ plugin_config {{ [{URL}] {{ {body} }} }} }} general {{ id: 5 }}"
    loaded = read(tmp_path, text)
    assert [item.code for item in loaded.diagnostics] == ["nesting-too-deep", "wrong-type"]


@pytest.mark.parametrize(
    "sign", ["{", "a{", "[", "a:[", "<", "a<", "a:", '"', "(", "a", "#", "}", "]", "[a", ":", ",", "-"]
)
def test_a_sign_repeated_many_times_ends_quickly(tmp_path: Path, sign: str) -> None:
    loaded = read(tmp_path, sign * 20_000)
    assert bool(loaded.diagnostics) == (sign != "#")
    assert len(loaded.diagnostics) <= 1001


def test_syntax_errors_name_the_field_that_they_stand_in(tmp_path: Path) -> None:
    loaded = read(tmp_path, "robot { actions { sts3215_config { motor_ids: [1 2] } node { node_id 5 } } }")
    assert [item.field_path for item in loaded.diagnostics] == [
        "robot.actions[0].sts3215_config.motor_ids",
        "robot.actions[0].node.node_id",
    ]


def test_a_value_that_cannot_be_read_is_set_and_broken(tmp_path: Path) -> None:
    loaded = read(
        tmp_path,
        "general { mode: MODE_TESTT name: 'x' } robot { actions { sts3215_config { motor_ids: [x] } } }",
    )
    positions = loaded.positions
    assert positions.is_set("general.mode")
    assert positions.is_broken("general.mode")
    assert not positions.is_broken("general.name")
    assert positions.is_broken("robot.actions[0].sts3215_config.motor_ids")
    assert loaded.config.general.mode == 0


def test_a_field_of_the_block_around_says_where_a_brace_is_missing(tmp_path: Path) -> None:
    loaded = read(tmp_path, "robot { actions { node { action_type: ACTION_LEADER } } }")
    assert loaded.diagnostics[0].remedy == (
        "Close the block above before it with }: action_type is a field of SingleAction."
    )


def test_a_field_of_a_block_inside_says_which(tmp_path: Path) -> None:
    loaded = read(tmp_path, 'robot { actions { sts3215_config { port: "x" } } }')
    assert loaded.diagnostics[0].remedy == "Move it into the block comm.serial, where port is a field."


def test_field_numbers_are_answered_with_names(tmp_path: Path) -> None:
    found = read(tmp_path, "general { 2: 'x' }").diagnostics[0]
    assert found.allowed[0] == "robot_type"
    assert found.remedy == "Write fields by name, not by number."


@pytest.mark.parametrize(
    ("text", "allowed"),
    [
        ("general { mode: 'MODE_TEST' }", "MODE_TEST"),
        ("general { mode: mode_test }", "MODE_TEST"),
        ("general { mode: TELEOPERATE }", "MODE_TELEOPERATE"),
        ("transport { domain_id: 2.0 }", "2"),
        ("transport { domain_id: '2' }", "whole number"),
        ("calibration_run { display: yes }", "true"),
        ("calibration_run { display: TRUE }", "true"),
        ("general { name: rig }", '"rig"'),
        ("robot { actions { node { publishers { data_type: 'sensor_msgs/Image' } } } }", "IMAGE"),
        ("robot { actions { node { publishers { data_type: 'sensor_msgs/msg/Joy' } } } }", "JOY"),
    ],
)  # fmt: skip
def test_the_nearest_value_is_offered_first(tmp_path: Path, text: str, allowed: str) -> None:
    assert read(tmp_path, text).diagnostics[0].allowed[0] == allowed


def test_an_unknown_type_near_a_known_one_is_an_error(tmp_path: Path) -> None:
    loaded = read(tmp_path, f"simulation {{ plugin_config {{ [a.b/{PACKAGE}.Sampel] {{ x: 1 }} }} }}")
    found = loaded.diagnostics[0]
    assert (found.code, found.severity.value) == ("unknown-plugin-type", "error")
    assert found.allowed == (f"{PACKAGE}.Sample",)


def test_an_unknown_type_of_another_plugin_is_a_note(tmp_path: Path) -> None:
    loaded = read(tmp_path, "simulation { plugin_config { [a.b/other.project.Settings] { x: 1 } } }")
    found = loaded.diagnostics[0]
    assert (found.code, found.severity.value) == ("plugin-type-not-installed", "note")
    assert loaded.config.simulation.plugin_config.type_url == "a.b/other.project.Settings"

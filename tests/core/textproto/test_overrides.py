"""``--set``: what each form changes, what it clears, and where its errors point."""

from __future__ import annotations

from pathlib import Path

import pytest
from joshua.config import LoadedConfig, load
from joshua.plan import Diagnostic
from joshua.schema import config_pb2
from third_party import URL, sample_class

TEXT = f"""\
general {{ mode: MODE_TEST name: "file" }}
robot {{
  actions {{
    node {{
      node_name: "leader_arm" node_id: 1
      publishers {{ topic_name: "/a" }} publishers {{ topic_name: "/b" }}
    }}
    sts3215_config {{ comm {{ serial {{ port: "/dev/ttyACM0" }} }} motor_ids: [1, 2, 3] velocity: 5 }}
  }}
  actions {{
    node {{ node_name: "gripper" }}
    plugin_config {{ [{URL}] {{ f_int32: 1 f_string: "old" }} }}
  }}
}}
calibration {{ arms {{ node_name: "leader_arm" motors {{ id: 1 }} }} }}
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "robot.pbtxt"
    path.write_text(TEXT)
    return path


def read(path: Path, *options: str) -> LoadedConfig:
    return load(path, overrides=options, message_types=[sample_class()])


def good(path: Path, *options: str) -> config_pb2.Config:
    loaded = read(path, *options)
    assert loaded.diagnostics == []
    return loaded.config


def only(loaded: LoadedConfig) -> Diagnostic:
    assert len(loaded.diagnostics) == 1, loaded.diagnostics
    return loaded.diagnostics[0]


def gripper(config: config_pb2.Config) -> object:
    sample = sample_class()()
    assert config.robot.actions[1].plugin_config.Unpack(sample)
    return sample


@pytest.mark.parametrize(
    "option",
    [
        "robot.actions[0].sts3215_config.comm.serial.port=/dev/ttyACM3",
        'robot.actions[0].sts3215_config.comm.serial.port="/dev/ttyACM3"',
        "robot.actions[leader_arm].sts3215_config.comm.serial.port: '/dev/' 'ttyACM3'",
        "robot.actions [ 'leader_arm' ] . sts3215_config.comm.serial { port: \"/dev/ttyACM3\" }",
        'robot.actions["leader_arm"].sts3215_config.comm=<serial < port: "/dev/ttyACM3" >>',
    ],
)
def test_a_string_is_replaced(path: Path, option: str) -> None:
    config = good(path, option)
    assert config.robot.actions[0].sts3215_config.comm.serial.port == "/dev/ttyACM3"
    assert list(config.robot.actions[0].sts3215_config.motor_ids) == [1, 2, 3]


@pytest.mark.parametrize("value", ["a b", "100%", "x=y", "/tmp/{a}", "it's", "", "a # b"])
def test_a_string_without_quotes_is_taken_as_it_stands(path: Path, value: str) -> None:
    if value:
        assert good(path, f"general.name={value}").general.name == value
    else:
        assert only(read(path, "general.name=")).message == "The option has no value."


def test_numbers_enums_and_lists_are_replaced(path: Path) -> None:
    config = good(
        path,
        "general.mode=MODE_TELEOPERATE",
        "robot.actions[0].sts3215_config.motor_ids=[7, 8]",
        "robot.actions[0].sts3215_config.velocity = 0x10",
        "robot.actions[0].node.qos { depth: 5 }",
    )
    assert config.general.mode == config_pb2.MODE_TELEOPERATE
    assert list(config.robot.actions[0].sts3215_config.motor_ids) == [7, 8]
    assert config.robot.actions[0].sts3215_config.velocity == 16
    assert config.robot.actions[0].node.qos.depth == 5


def test_the_last_option_wins(path: Path) -> None:
    assert good(path, "general.name=a", "general.name=b").general.name == "b"


def test_a_block_replaces_the_whole_block(path: Path) -> None:
    config = good(path, 'general { id: "new" }')
    assert config.general == config_pb2.General(id="new")


def test_one_entry_of_a_list_is_replaced_or_added(path: Path) -> None:
    config = good(
        path,
        "robot.actions[0].sts3215_config.motor_ids[1]=9",
        "robot.actions[0].sts3215_config.motor_ids[3]=4",
        'robot.actions[0].node.publishers[1] { data_type: IMAGE }',
        'robot.actions[0].node.publishers[2] { topic_name: "/c" }',
        "robot.perceptions[0].camera_config.fps=30",
        "calibration.arms[leader_arm].motors[0].id=6",
    )  # fmt: skip
    action = config.robot.actions[0]
    assert list(action.sts3215_config.motor_ids) == [1, 9, 3, 4]
    assert [item.topic_name for item in action.node.publishers] == ["/a", "", "/c"]
    assert action.node.publishers[1].data_type == 48
    assert config.robot.perceptions[0].camera_config.fps == 30
    assert config.calibration.arms[0].motors[0].id == 6


def test_a_list_without_an_index_is_replaced_as_a_whole(path: Path) -> None:
    config = good(path, 'robot.actions { node { node_name: "one" } }')
    assert [action.node.node_name for action in config.robot.actions] == ["one"]
    config = good(path, "robot.actions[0].sts3215_config.motor_ids=5")
    assert list(config.robot.actions[0].sts3215_config.motor_ids) == [5]


def test_another_member_of_a_oneof_replaces_the_first(path: Path) -> None:
    loaded = read(path, "robot.actions[0].mock_motor_config.num_motors=6")
    assert loaded.diagnostics == []
    action = loaded.config.robot.actions[0]
    assert action.WhichOneof("actuator_config") == "mock_motor_config"
    assert not loaded.positions.is_set("robot.actions[0].sts3215_config.velocity")
    assert loaded.positions.is_set("robot.actions[0].mock_motor_config")
    # Back again, by a block, within the same run.
    loaded = read(
        path, "robot.actions[0].mock_motor_config.num_motors=6", "robot.actions[0].sts3215_config { }"
    )
    assert loaded.diagnostics == []
    assert loaded.config.robot.actions[0].WhichOneof("actuator_config") == "sts3215_config"


def test_a_field_of_a_plugin_block_is_replaced(path: Path) -> None:
    loaded = read(
        path, "robot.actions[gripper].plugin_config.f_string=new", "robot.actions[1].plugin_config.left=3"
    )
    assert loaded.diagnostics == []
    assert gripper(loaded.config) == sample_class()(f_int32=1, f_string="new", left=3)
    place = loaded.positions.value("robot.actions[1].plugin_config.f_string")
    assert str(place) == "--set:1:47"


def test_a_plugin_block_is_replaced(path: Path) -> None:
    config = good(path, f"robot.actions[gripper].plugin_config {{ [{URL}] {{ f_bool: true }} }}")
    assert gripper(config) == sample_class()(f_bool=True)
    config = good(path, f"robot.actions[leader_arm].plugin_config {{ [{URL}] {{ }} }}")
    assert config.robot.actions[0].WhichOneof("actuator_config") == "plugin_config"


def test_positions_point_into_the_option(path: Path) -> None:
    loaded = read(path, "general.name=a", "robot.actions[0].sts3215_config.velocity=7")
    place = loaded.positions.value("robot.actions[0].sts3215_config.velocity")
    assert (str(place), place and place.length) == ("--set:2:42", 1)
    assert str(loaded.positions.name("general.name")) == "--set:1:9"
    assert loaded.sources["--set"] == "general.name=a\nrobot.actions[0].sts3215_config.velocity=7"
    assert str(loaded.positions.value("general.mode")).startswith(str(path))


def test_an_option_settles_what_the_file_left_out(path: Path) -> None:
    loaded = read(path, "transport.domain_id=0")
    assert loaded.positions.is_set("transport.domain_id")
    assert loaded.positions.is_set("transport")


@pytest.mark.parametrize(
    ("option", "code", "column", "message"),
    [
        ("", "override-syntax", 1, "--set '' cannot be read: expected a field name here."),
        ("general", "override-syntax", 7, "expected = and a value, or a block in braces"),
        ("general.", "override-syntax", 8, "expected a field name here"),
        ("=5", "override-syntax", 1, "expected a field name here"),
        ("general.name[", "override-syntax", 12, "after the path"),
        ("general.nme=x", "unknown-field", 9, "General has no field nme."),
        ("genral.name=x", "unknown-field", 1, "Config has no field genral."),
        ("general.name.x=1", "unknown-field", 14, "name is a string in double quotes and has no fields."),
        ("general[0].name=x", "override-index", 1, "general has a single value and takes no index."),
        ("robot.actions.node.node_id=1", "override-index", 7, "actions is a list. Name one of its"),
        ("robot.actions[5].node.node_id=1", "override-index", 7, "actions has no entry [5]; it has 2"),
        ("robot.actions[nobody].node.node_id=1", "override-index", 7, "actions has no entry [nobody]"),
        ("robot.actions[-1].node.node_id=1", "override-index", 7, "actions has no entry [-1]"),
        ("robot.perceptions[1].node.node_id=1", "override-index", 7, "perceptions has no entry [1]"),
        ("general.mode=MODE_TELOPERATE", "unknown-enum-value", 14, "OperationMode has no value"),
        ("robot.actions[0].node.node_id=x", "wrong-type", 31, "node_id takes a whole number."),
        ("robot.actions[0].node=5", "wrong-type", 23, "node is a block of fields, not one value."),
        ("robot.actions[0]=5", "wrong-type", 18, "actions is a block of fields, not one value."),
        ("robot.actions[0].node.node_id=1 2", "unexpected-text", 33, "Unexpected '2' after the value."),
        ("robot.actions[0].node { node_idd: 1 }", "unknown-field", 25, "Node has no field node_idd."),
        ("robot.actions[0].node { node_id: 1", "unclosed-block", 23, "is not closed"),
        ("robot.actions[0].sts3215_config.motor_ids[0]=[1]", "wrong-type", 46, "is one entry, not a list."),
        ("include=x.pbtxt", "override-include", 1, "include cannot be set with --set."),
        ("simulation.plugin_config.stroke=1", "override-syntax", 26, "has no type yet"),
        ('general.name="x', "unclosed-string", 14, "The string is not closed on its line."),
        ("general.name { x: 1 }", "wrong-type", 14, "name takes a string in double quotes, not a block."),
        ("general.name=\udcff", "not-utf8-string", 14, "The byte 0xff of this string is not UTF-8 text."),
        ('general.name="\udcff"', "not-utf8-string", 14, "The byte 0xff of this string is not UTF-8"),
        (r'general.name="a\n' + '\udcff"', "not-utf8-string", 14, "The byte 0xff of this string is not"),
        ('general.name="\ud800"', "not-utf8-string", 14, "The byte 0xed of this string is not UTF-8"),
    ],
)  # fmt: skip
def test_what_is_said_about_a_wrong_option(
    path: Path, option: str, code: str, column: int, message: str
) -> None:
    found = only(read(path, "general.name=first", option))
    assert found.code == code
    assert message in found.message
    assert str(found.position) == f"--set:2:{column}"
    assert found.remedy


def test_entries_are_offered_by_index_and_name(path: Path) -> None:
    found = only(read(path, "robot.actions[nobody].node.node_id=1"))
    assert found.allowed == ("actions[0] (leader_arm)", "actions[1] (gripper)")


def test_a_name_that_two_entries_carry_is_refused(path: Path) -> None:
    path.write_text('robot { actions { node { node_name: "a" } } actions { node { node_name: "a" } } }')
    found = only(read(path, "robot.actions[a].node.node_id=1"))
    assert found.message == "2 entries of actions are named a."


def test_a_line_break_in_an_option_does_not_move_later_options(path: Path) -> None:
    loaded = read(path, "general {\n id: 'x' }", "general.nme=x")
    assert str(only(loaded).position) == "--set:2:9"
    assert loaded.config.general.id == "x"


def test_options_are_not_applied_to_a_file_that_is_not_there(tmp_path: Path) -> None:
    loaded = load(tmp_path / "none.pbtxt", overrides=["general.name=x"])
    assert [item.code for item in loaded.diagnostics] == ["file-missing"]
    assert not loaded.is_readable

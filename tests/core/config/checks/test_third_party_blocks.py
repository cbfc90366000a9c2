"""Blocks of third parties are held against the rules of their own schema, like built-in ones."""

from __future__ import annotations

from pathlib import Path

from google.protobuf import descriptor_pb2
from joshua.config import check, load
from joshua.plan import Diagnostic
from joshua.schema import comm_pb2
from joshua.schema import config_pb2 as pb

ACTION = """
  actions {{
    node {{ node_name: "{name}" node_id: {number} }}
    action_type: ACTION_PLUGIN
    plugin_config {{ [type.example.org/{block}] {{ {fields} }} }}
  }}
"""


def examine(tmp_path: Path, *blocks: tuple[str, str]) -> list[Diagnostic]:
    path = tmp_path / "robot.pbtxt"
    actions = "".join(
        ACTION.format(name=f"arm_{number}", number=number, block=block, fields=fields)
        for number, (block, fields) in enumerate(blocks)
    )
    path.write_text(f"general {{ mode: MODE_TEST }}\nrobot {{ {actions} }}\n", encoding="utf-8")
    types = [pb.MockMotorConfig, comm_pb2.Serial, descriptor_pb2.UninterpretedOption.NamePart]
    loaded = load(str(path), message_types=types)
    return [*loaded.diagnostics, *check(loaded)]


def test_a_valid_block_has_no_findings(tmp_path: Path) -> None:
    assert examine(tmp_path, ("joshua.MockMotorConfig", "num_motors: 6 position_max: 4095")) == []


def test_ranges_and_required_fields_hold(tmp_path: Path) -> None:
    found = examine(tmp_path, ("joshua.MockMotorConfig", "num_motors: 65"))
    assert [(item.code, item.field_path) for item in found] == [
        ("out-of-range", "robot.actions[0].plugin_config.num_motors"),
        ("required-missing", "robot.actions[0].plugin_config.position_max"),
    ]
    assert found[0].position is not None
    assert found[0].position.line == 6
    assert found[0].allowed == ("1 to 64",)


def test_lower_limits_lie_below_upper_ones(tmp_path: Path) -> None:
    (found,) = examine(tmp_path, ("joshua.MockMotorConfig", "num_motors: 1 position_min: 9 position_max: 3"))
    assert (found.code, found.field_path) == (
        "limits-inverted",
        "robot.actions[0].plugin_config.position_max",
    )


def test_devices_are_used_once(tmp_path: Path) -> None:
    port = ("joshua.Serial", 'port: "/dev/ttyACM0" baudrate: 1000000')
    (found,) = examine(tmp_path, port, port)
    assert (found.code, found.field_path) == ("serial-port-shared", "robot.actions[1].plugin_config.port")


def test_a_misspelt_type_has_the_nearest_beside_it(tmp_path: Path) -> None:
    (found,) = examine(tmp_path, ("joshua.MockMotorConfg", "num_motors: 1"))
    assert found.code == "unknown-plugin-type"
    assert found.allowed[0] == "joshua.MockMotorConfig"


def test_fields_that_the_third_party_requires_must_be_there(tmp_path: Path) -> None:
    found = examine(tmp_path, ("google.protobuf.UninterpretedOption.NamePart", 'name_part: "a"'))
    assert [item.code for item in found] == ["plugin-block-incomplete"]
    assert found[0].allowed == ("is_extension",)

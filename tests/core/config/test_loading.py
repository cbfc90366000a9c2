"""Loading one file: the message, the places of its fields, and what is never raised."""

from __future__ import annotations

from pathlib import Path

from google.protobuf import text_format
from joshua.config import load
from joshua.plan import Position
from joshua.schema.config_pb2 import Config

TEXT = """\
# A small rig.
general { mode: MODE_TEST name: "rig" }
robot {
  actions {
    node {
      node_name: "leader_arm"
      node_id: 0
    }
    sts3215_config {
      comm { serial { port: "/dev/ttyACM0" baudrate: 1000000 } }
      motor_ids: [1, 2, 3]
      motor_ids: 4
    }
  }
}
"""


def test_a_file_becomes_the_message_that_text_format_reads(tmp_path: Path) -> None:
    path = tmp_path / "robot.pbtxt"
    path.write_text(TEXT)
    loaded = load(path)
    assert loaded.diagnostics == []
    assert loaded.config == text_format.Parse(TEXT, Config())
    assert loaded.sources == {str(path): TEXT}


def test_each_field_remembers_where_it_stands(tmp_path: Path) -> None:
    path = tmp_path / "robot.pbtxt"
    path.write_text(TEXT)
    positions = load(str(path)).positions

    def place(line: int, column: int, length: int) -> Position:
        return Position(file=str(path), line=line, column=column, length=length)

    assert positions.name("general") == place(2, 1, 7)
    assert positions.value("general") == place(2, 1, 7)
    assert positions.value("general.mode") == place(2, 17, 9)
    assert positions.value("general.name") == place(2, 33, 5)
    assert positions.name("robot.actions[0]") == place(4, 3, 7)
    arm = "robot.actions[0].sts3215_config"
    assert positions.value(f"{arm}.comm.serial.port") == place(10, 29, 14)
    assert positions.name(f"{arm}.comm.serial.baudrate") == place(10, 44, 8)
    assert positions.value(f"{arm}.motor_ids") == place(11, 18, 9)
    assert positions.value(f"{arm}.motor_ids[1]") == place(11, 22, 1)
    assert positions.value(f"{arm}.motor_ids[3]") == place(12, 18, 1)
    assert positions.value(f"{arm}.velocity") is None
    assert positions.nearest(f"{arm}.velocity") == place(9, 5, 14)


def test_a_field_that_is_written_as_zero_is_set(tmp_path: Path) -> None:
    path = tmp_path / "robot.pbtxt"
    path.write_text(TEXT)
    positions = load(path).positions
    assert positions.is_set("robot.actions[0].node.node_id")
    assert not positions.is_set("robot.actions[0].node.node_type")

"""``joshua explain``: each kind of name finds its page, and the page holds what the schema says."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from joshua.config.codes import CODES
from joshua.config.explain import Catalogue, explain, overview
from joshua.schema.comments import comment
from joshua.schema.compile import compile_protos
from joshua.schema.config_pb2 import Config
from joshua.textproto.plugin_types import PluginTypes

PROTO = """\
syntax = "proto3";
package acme.explain_test;
import "joshua/schema/options.proto";
// A parallel gripper. It has two fingers.
message GripperConfig {
  // Distance between the open fingers.
  float stroke_m = 1 [(joshua.rule) = {unit: "m" above: 0 max: 0.2 required: true example: "0.1"}];
}
"""


def page(query: str, width: int = 100, catalogue: Catalogue | None = None) -> str:
    catalogue = catalogue or Catalogue()
    found = catalogue.find(query)
    assert found, f"{query} is unknown"
    return explain(found, catalogue, width)


def test_a_field_is_explained_in_full() -> None:
    assert page("robot.actions[0].sts3215_config.motor_ids") == (
        "robot.actions.sts3215_config.motor_ids: list: whole number for each entry\n"
        "\n"
        "  Bus ids of the servos, in joint order.\n"
        "\n"
        "  names     A motor's id on its bus; unique within one block\n"
        "  range     0 to 253\n"
        "  entries   1 to 32\n"
        "  required  yes\n"
        "  example   motor_ids: [1, 2, 3, 4, 5, 6]\n"
        "  schema    joshua.STS3215Config, field 2 (specification)\n"
    )


@pytest.mark.parametrize(
    ("query", "parts"),
    [
        ("robot.actions.node.qos.depth", ["range     0 to 100000", "default   10", "field 4 (spec"]),
        ("robot.actions.node.qos.deadline_s", ["0 to 86400 s", "field 100 (extension)"]),
        ("general.mode", ["name of OperationMode", "required  yes", "MODE_TELEOPERATE  A person"]),
        ("robot.actions.mock_motor_config", ["excludes  sts3215", "motion_file           CSV file"]),
        ("robot.actions[leader_arm].node", ["node_name", "Base name of the ROS 2 node."]),
        ("sts3215_config.motor_ids", ["robot.actions.sts3215_config.motor_ids: list"]),
        ("ai.training.imitation_config.loss_function", ['allowed   "mse", "l1"', 'loss_function: "l1"']),
        ("STS3215Config", ["used by   robot.actions.sts3215_config", "velocity"]),
        ("joshua.STS3215Config", ["joshua.STS3215Config: block"]),
        ("Publisher.qos.depth", ["Publisher.qos.depth: whole number"]),
        ("ActionType", ["ACTION_LEADER", "needs plugin_config. [extension]"]),
        ("MODE_TEST", ["MODE_TEST: value of OperationMode", "used by   general.mode"]),
        ("OperationMode.MODE_TEST", ["number 5 (specification)"]),
        ("JOINT_STATE", ["sensor_msgs/msg/JointState", "number 50 (specification)"]),
        ("PERCEPTION_GAMEPAD", ["number 101 (extension)"]),
        ("calibration.arms", ["field 1 (extension)"]),
        ("unknown-field", [f"cause     {CODES['unknown-field'].cause}", "do        "]),
        ("topic_name", ["Several fields", "publishers.topic_name", "subscriptions.topic_name"]),
        ("robot.actions.plugin_config", ["block of a plugin", "No installed plugin"]),
    ],
)  # fmt: skip
def test_each_kind_of_name_finds_its_page(query: str, parts: list[str]) -> None:
    text = page(query)
    for part in parts:
        assert part in text, text


@pytest.mark.parametrize(
    ("query", "first"),
    [
        ("robot.actons.node", "robot.actions.node"),
        ("robot.actions.node.qos.depht", "robot.actions.node.qos.depth"),
        ("simulaton", "simulation"),
        ("MODE_TELEOP", "MODE_TELEOPERATE"),
        ("motor_idsz", "robot.actions.sts3215_config.motor_ids"),
        ("STS3215Confg", "STS3215Config"),
        ("robot.zzzzzz", "robot"),
        ("general.mode.value", "general.mode"),
        ("unknown-feild", "unknown-field"),
    ],
)
def test_an_unknown_name_brings_the_nearest_first(query: str, first: str) -> None:
    catalogue = Catalogue()
    assert catalogue.find(query) == []
    assert catalogue.suggestions(query)[0] == first


def test_every_field_message_enum_value_and_code_has_a_page() -> None:
    catalogue = Catalogue()
    names = [place.path for place in catalogue.places]
    names += [*catalogue.messages, *catalogue.enums, *CODES]
    names += [value.name for enum in catalogue.enums.values() for value in enum.values]
    assert len(names) > 600
    for name in names:
        text = page(name, 60, catalogue)
        assert text.endswith("\n")
        assert len(text.splitlines()) >= 3


def test_every_field_page_holds_the_comment_of_the_schema() -> None:
    catalogue = Catalogue()
    for place in catalogue.places:
        text = " ".join(page(place.path, 80, catalogue).split())
        assert " ".join(comment(place.field).split()) in text


def test_the_overview_lists_the_blocks() -> None:
    text = overview(80)
    for field in Config.DESCRIPTOR.fields:
        assert f"\n  {field.name} " in text
    assert "joshua explain robot.actions" in text


def test_lines_keep_to_the_width() -> None:
    for query in ("robot.actions.node", "robot.actions.sts3215_config.velocity", "general.mode", "MODE_TEST"):
        assert max(map(len, page(query, 60).splitlines())) <= 62


@pytest.fixture
def gripper(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Catalogue]:
    """A catalogue with a plugin's compiled message, comments beside it."""
    package = tmp_path / "acme_explain"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "gripper.proto").write_text(PROTO)
    root = Path(sys.modules["joshua.schema.compile"].__file__ or "").parents[2]
    compile_protos(["acme_explain/gripper.proto"], [str(tmp_path), str(root)], tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    importlib.invalidate_caches()
    yield Catalogue(lambda: PluginTypes(["acme_explain.gripper_pb2"]))
    for name in ("acme_explain", "acme_explain.gripper_pb2"):
        sys.modules.pop(name, None)


def test_a_plugin_block_is_explained_from_its_own_proto(gripper: Catalogue) -> None:
    block = page("acme.explain_test.GripperConfig", catalogue=gripper)
    assert "A parallel gripper. It has two fingers." in block
    assert "stroke_m" in block
    for query in ("acme.explain_test.GripperConfig.stroke_m", "robot.actions[1].plugin_config.stroke_m"):
        field = page(query, catalogue=gripper)
        assert "Distance between the open fingers." in field
        assert "range     above 0, at most 0.2 m" in field
        assert "field 1 of acme_explain/gripper.proto" in field
    listing = page("robot.actions.plugin_config", catalogue=gripper)
    assert "acme.explain_test.GripperConfig" in listing
    assert "A parallel gripper." in listing
    assert gripper.suggestions("acme.explain_test.GripperConfg")[0] == "acme.explain_test.GripperConfig"

"""What the schema states of plugins, and what the core therefore does not know itself."""

from __future__ import annotations

import ast
from pathlib import Path

import joshua
from joshua.plugins.hints import distribution_for, emulator_for, stated
from joshua.schema.config_pb2 import SingleAction, SinglePerception

SOURCE = Path(joshua.__file__).parent


def test_blocks_values_and_commands_name_their_distribution() -> None:
    assert distribution_for("camera_config") == "joshua-camera"
    assert distribution_for("", "SMOLVLA") == "joshua-smolvla"
    assert distribution_for("acme.GripperConfig", "ACTION_PLUGIN") == ""
    assert emulator_for("sts3215_config") == "joshua-emulator"
    assert stated().commands["motors"] == "joshua-servo"
    assert stated().commands["share-gamepad"] == "joshua-teleop-input"


def test_every_block_of_a_device_says_who_brings_it() -> None:
    oneofs = (
        SingleAction.DESCRIPTOR.oneofs_by_name["actuator_config"],
        SinglePerception.DESCRIPTOR.oneofs_by_name["device_config"],
    )
    names = {field.name for oneof in oneofs for field in oneof.fields} - {"plugin_config"}
    assert {name for name in names if not distribution_for(name)} == set()


def test_the_core_names_no_device_that_a_plugin_brings() -> None:
    """A first-party device needs nothing that a third party's could not have."""
    oneofs = (SingleAction.DESCRIPTOR.oneofs[0], SinglePerception.DESCRIPTOR.oneofs[0])
    members = {field.name: field.message_type.name for oneof in oneofs for field in oneof.fields}
    names = {name for name in members if distribution_for(name) not in ("", "joshua-core")}
    names |= {members[name] for name in names}
    names |= stated().distributions() - {"joshua-core"}
    found = [
        f"{path.relative_to(SOURCE)}:{node.lineno}: {text}"
        for path in SOURCE.rglob("*.py")
        if not path.stem.endswith("_pb2")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, (ast.Constant, ast.Attribute))
        and isinstance(text := node.value if isinstance(node, ast.Constant) else node.attr, str)
        and text in names
    ]
    assert found == []

"""A third party's block states what its device needs, and is checked like a built-in one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from google.protobuf import descriptor_pb2, descriptor_pool
from joshua.config import check, load
from joshua.schema import comm_pb2, options_pb2

NAME = "acme.bus_test.ArmConfig"
_Field = descriptor_pb2.FieldDescriptorProto


@pytest.fixture(scope="module", autouse=True)
def _message() -> None:
    """Registers the message of a bus of servos with a protocol of its own."""
    file = descriptor_pb2.FileDescriptorProto(
        name="acme_bus_test/arm.proto", package="acme.bus_test", syntax="proto3"
    )
    file.dependency.extend([comm_pb2.DESCRIPTOR.name, options_pb2.DESCRIPTOR.name])
    arm = file.message_type.add(name="ArmConfig")
    arm.field.add(
        name="comm", number=1, type=_Field.TYPE_MESSAGE, type_name=".joshua.Comm", label=_Field.LABEL_OPTIONAL
    )
    ids = arm.field.add(name="servos", number=2, type=_Field.TYPE_INT32, label=_Field.LABEL_REPEATED)
    extensions: Any = options_pb2  # whose stubs know its extensions as plain descriptors
    ids.options.Extensions[extensions.rule].kind = options_pb2.KIND_MOTOR_ID
    rule = arm.options.Extensions[extensions.block]
    rule.link = "serial"
    rule.publishes.append("JOINT_STATE")
    rule.bus.request, rule.bus.reply, rule.bus.feedback, rule.bus.command = 10, 10, 10, 10
    descriptor_pool.Default().AddSerializedFile(file.SerializeToString())


def file(block: str, publisher: str) -> str:
    return f"""
        general {{ mode: MODE_TEST id: "r" name: "r" }}
        robot {{ actions {{
          node {{ node_name: "arm" node_id: 1 node_type: PYTHON
            publishers {{ topic_name: "/arm" {publisher} }} }}
          action_type: ACTION_PLUGIN
          plugin_config {{ [type.example.org/{NAME}] {{ {block} }} }}
        }} }}"""


SERIAL = 'comm { serial { port: "/dev/ttyACM0" baudrate: 100000 } } servos: [1, 2]'


def test_its_bus_bounds_the_rate(messages: Callable[[str], dict[str, str]]) -> None:
    found = messages(file(SERIAL, "data_type: JOINT_STATE publish_rate_hz: 1000"))
    # 10 + 2 bytes ask, 2 * 20 bytes answer: 520 bits at 100000 bit/s
    assert "2 servos: sync read 12 + replies 40 = 52 bytes = 520 bits" in found["rate-above-bus"]
    assert "rate-above-bus" not in messages(file(SERIAL, "data_type: JOINT_STATE publish_rate_hz: 100"))


def test_its_link_and_its_messages_are_checked(messages: Callable[[str], dict[str, str]]) -> None:
    radio = 'comm { ble { device_name: "hub" } } servos: [1, 2]'
    found = messages(file(radio, "data_type: IMAGE publish_rate_hz: 10"))
    assert found["link-unfit"] == "plugin_config needs a serial link; the device has no other."
    assert found["data-type-unfit"] == "arm (plugin_config) cannot publish IMAGE."


@pytest.fixture
def messages(tmp_path: Path) -> Callable[[str], dict[str, str]]:
    """Checks a text; messages by code."""

    def checked(text: str) -> dict[str, str]:
        path = tmp_path / "robot.pbtxt"
        path.write_text(text)
        loaded = load(str(path))
        return {item.code: item.message for item in (*loaded.diagnostics, *check(loaded))}

    return checked

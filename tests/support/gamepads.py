"""Settings and node specs of gamepads for tests."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from google.protobuf import text_format
from joshua.plan import JointRange, NodeKind, NodeSpec, SensorFacts, TopicSpec
from joshua.plugins.block_context import BlockContext
from joshua.schema import config_pb2 as pb
from joshua_emulator import EmulatedGamepad
from joshua_teleop_input.settings import GamepadSettings, InputSettings, KeyboardSettings

JOINT_STATE = "sensor_msgs/msg/JointState"
JOY = "sensor_msgs/msg/Joy"
COMMANDS = "/gamepad/joint_commands"
STATE = "/arm/joint_states"
JOINTS = (JointRange("pan", -1.0, 1.0), JointRange("lift", -2.0, 2.0))
NODE = """
  publishers { data_type: JOINT_STATE topic_name: "/gamepad/joint_commands" publish_rate_hz: 50 }
  subscriptions { data_type: JOINT_STATE topic_name: "/arm/joint_states" }
"""
STICK = 'controls { positive: "left_x" joint: "pan" speed_rad_s: 1.0 }'
PAIR = 'controls { positive: "a" negative: "b" joint: "lift" speed_rad_s: 0.5 }'


def gamepad_settings(
    block: str = STICK, *, node: str = NODE, joints: Sequence[JointRange] = ()
) -> GamepadSettings:
    """Settings of a ``gamepad_config`` as a file has it."""
    message = text_format.Parse(block, pb.GamepadConfig())
    context = BlockContext(joints=tuple(joints))
    return GamepadSettings.from_block(message, text_format.Parse(node, pb.Node()), context)


def keyboard_settings(block: str, *, node: str = NODE) -> KeyboardSettings:
    """Settings of a ``keyboard_config`` as a file has it."""
    message = text_format.Parse(block, pb.KeyboardConfig())
    return KeyboardSettings.from_block(message, text_format.Parse(node, pb.Node()))


def wait_until_reported(pad: EmulatedGamepad) -> None:
    """Waits until an emulated gamepad has reported what was done to it."""
    wait_until(lambda: pad.ask("state")["reported"], "the report")


def node_spec(settings: InputSettings, *, joy: bool = False, rate_hz: float = 50.0) -> NodeSpec:
    """The plan of a gamepad's node that drives two joints."""
    topics = [TopicSpec(name=COMMANDS, type_name=JOINT_STATE, rate_hz=rate_hz)]
    if joy:
        topics.append(TopicSpec(name="/joy", type_name=JOY, rate_hz=rate_hz))
    return NodeSpec(
        name="gamepad",
        kind=NodeKind.SENSOR,
        behaviour="joshua_teleop_input.gamepad_node:GamepadNode",
        implementation="joshua_teleop_input.gamepad:Gamepad",
        settings_type="joshua_teleop_input.settings:GamepadSettings",
        settings=settings.model_dump(mode="json"),
        facts=SensorFacts(joints=JOINTS),
        publishers=tuple(topics),
        subscriptions=(TopicSpec(name=STATE, type_name=JOINT_STATE),),
    )


def wait_until(condition: Callable[[], object], what: str = "it") -> None:
    """Waits for something that another thread or process brings about."""
    deadline_s = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < deadline_s, f"{what} did not happen"
        time.sleep(0.005)

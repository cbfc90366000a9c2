"""Which block, link and message types fit which device."""

from __future__ import annotations

from typing import Any, NamedTuple

from joshua.schema import config_pb2 as pb
from joshua.schema import data_type_pb2 as types

# Members of the fixed oneofs that hold the settings of a device.
_ONEOFS = {pb.SingleAction: "actuator_config", pb.SinglePerception: "device_config"}

ACTUATOR_BLOCKS = tuple(
    field.name for field in pb.SingleAction.DESCRIPTOR.oneofs_by_name["actuator_config"].fields
)
DEVICE_BLOCKS = tuple(
    field.name for field in pb.SinglePerception.DESCRIPTOR.oneofs_by_name["device_config"].fields
)

# Actuators without hardware: their zero is known by definition.
VIRTUAL_BLOCKS = ("mock_motor_config", "sim_config")

# An action type that is not named here fits every actuator block.
_ACTION_BLOCKS = {
    pb.ACTION_MOCK: ("mock_motor_config",),
    pb.ACTION_SPIKE: ("spike_motor_config",),
    pb.ACTION_PLUGIN: ("plugin_config",),
}
_PERCEPTION_BLOCKS = {
    pb.PERCEPTION_CAMERA: ("camera_config", "mock_camera_config", "sim_camera_config"),
    pb.PERCEPTION_ENCODER: ("encoder_config", "mock_encoder_config"),
    pb.PERCEPTION_LIDAR: ("lidar_config", "mock_lidar_config"),
    pb.PERCEPTION_GAMEPAD: ("gamepad_config",),
    pb.PERCEPTION_KEYBOARD: ("keyboard_config",),
    pb.PERCEPTION_PLUGIN: (),
}

# The link that a device needs; a block that is not named here takes either.
LINKS = {"sts3215_config": "serial", "dynamixel_config": "serial", "spike_motor_config": "ble"}


class Messages(NamedTuple):
    """DataType numbers that a device can publish and can listen to; None: any."""

    publishes: tuple[int, ...] | None
    hears: tuple[int, ...] | None


_COMMANDS = (types.JOINT_STATE, types.JOINT_TRAJECTORY)
_ACTUATOR = Messages((types.JOINT_STATE,), _COMMANDS)
# Actuators that publish more than their joints.
_ACTUATORS = {"spike_motor_config": Messages((types.JOINT_STATE, types.BATTERY_STATE), _COMMANDS)}
_PERCEPTIONS = {
    pb.PERCEPTION_CAMERA: Messages((types.IMAGE, types.COMPRESSED_IMAGE, types.CAMERA_INFO), ()),
    pb.PERCEPTION_ENCODER: Messages((types.JOINT_STATE,), ()),
    pb.PERCEPTION_LIDAR: Messages((types.LASER_SCAN,), ()),
    pb.PERCEPTION_GAMEPAD: Messages((types.JOINT_STATE, types.JOY), (types.JOINT_STATE,)),
    pb.PERCEPTION_KEYBOARD: Messages((types.JOINT_STATE, types.JOY), (types.JOINT_STATE,)),
}
_MODEL = Messages((types.JOINT_STATE, types.JOINT_TRAJECTORY), None)


def block_of(owner: Any) -> tuple[str, Any]:
    """Name and content of the settings block of an action or perception; ("", None) where there is none."""
    oneof = _ONEOFS.get(type(owner))
    name = owner.WhichOneof(oneof) if oneof else None
    return (name, getattr(owner, name)) if name else ("", None)


def fitting_blocks(owner: Any) -> tuple[str, ...]:
    """Blocks that fit the type of an action or perception, the usual one first."""
    if isinstance(owner, pb.SingleAction):
        return _ACTION_BLOCKS.get(owner.action_type, ACTUATOR_BLOCKS)
    own = [name for name in _PERCEPTION_BLOCKS.get(owner.perception_type, ()) if name in DEVICE_BLOCKS]
    return (*own, "plugin_config")


def fitting_types(owner: Any, block_name: str) -> tuple[str, ...]:
    """Names of the action or perception types that a block fits, the usual one first."""
    if isinstance(owner, pb.SingleAction):
        special = [number for number, names in _ACTION_BLOCKS.items() if block_name in names]
        general = [pb.ACTION_LEADER, pb.ACTION_FOLLOWER, pb.ACTION_SINGLE]
        return tuple(pb.ActionType.Name(number) for number in [*special, *general])
    fitting = [number for number, names in _PERCEPTION_BLOCKS.items() if block_name in names]
    return tuple(pb.PerceptionType.Name(number) for number in fitting)


def messages_of(owner: Any) -> Messages:
    """Message types that the node of an action, perception or model can publish and listen to.

    A third party's device decides for itself, so everything is allowed here.
    """
    if isinstance(owner, pb.SingleModel):
        return Messages(None, None) if owner.HasField("plugin_config") else _MODEL
    block_name, _ = block_of(owner)
    if block_name == "plugin_config":
        return Messages(None, None)
    if isinstance(owner, pb.SingleAction):
        return _ACTUATORS.get(block_name, _ACTUATOR)
    return _PERCEPTIONS.get(owner.perception_type, Messages(None, None))

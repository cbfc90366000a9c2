"""The block, link and message types of each device, as declared in the schema."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

from joshua.config.checks.context import unpacked
from joshua.schema import config_pb2 as pb
from joshua.schema import data_type_pb2 as types
from joshua.schema import options_pb2
from joshua.schema.rules import block_rule
from joshua.textproto.field_facts import field_facts

PLUGIN_BLOCK = "plugin_config"

# Members of the fixed oneofs that hold the settings of a device, and the enum of their type.
_ONEOFS: dict[Any, tuple[str, str, Any]] = {
    pb.SingleAction: ("actuator_config", "action_type", pb.ActionType),
    pb.SinglePerception: ("device_config", "perception_type", pb.PerceptionType),
}
MEMBERS = {
    owner: {field.name: field.message_type for field in owner.DESCRIPTOR.oneofs_by_name[oneof].fields}
    for owner, (oneof, _, _) in _ONEOFS.items()
}


class Messages(NamedTuple):
    """DataType numbers that a device can publish and subscribe to; None: any."""

    publishes: tuple[int, ...] | None
    takes: tuple[int, ...] | None


_ANY = Messages(None, None)
_ACTUATOR = Messages((types.JOINT_STATE,), (types.JOINT_STATE, types.JOINT_TRAJECTORY))
_MODEL = Messages((types.JOINT_STATE, types.JOINT_TRAJECTORY), None)


def value_name(enum: Any, number: int) -> str:
    """Name of an enum value, or its number if it has none."""
    return str(enum.Name(number)) if number in enum.values() else str(number)


def type_text(number: int) -> str:
    """Name of a DataType number, or the number if it has none."""
    return value_name(types.DataType, number)


def block_of(owner: Any) -> tuple[str, Any]:
    """Name and content of the settings block of an action or perception; ("", None) if there is none."""
    oneof = _ONEOFS.get(type(owner))
    name = owner.WhichOneof(oneof[0]) if oneof else None
    return (name, getattr(owner, name)) if name else ("", None)


def device_block(owner: Any) -> tuple[str, Any, options_pb2.BlockRule]:
    """Name, content and rule of the block of an action or perception; that of a third party is unpacked."""
    name, content = block_of(owner)
    if name == PLUGIN_BLOCK:
        content = unpacked(content)
    return name, content, options_pb2.BlockRule() if content is None else block_rule(content.DESCRIPTOR)


def frame_rate(owner: Any) -> tuple[str, float]:
    """Name and value of the field with a camera's frame rate; ("", 0) for others."""
    _, content, _ = device_block(owner)
    for facts in field_facts(content.DESCRIPTOR) if content is not None else ():
        if facts.kind == options_pb2.KIND_FRAME_RATE:
            return facts.name, getattr(content, facts.name)
    return "", 0.0


@cache
def _blocks_that_fit(owner: Any, type_name: str) -> tuple[str, ...]:
    members = MEMBERS[owner].items()
    return tuple(name for name, message in members if type_name in block_rule(message).fits)


@cache
def _roles() -> tuple[str, ...]:
    """Action types open to every actuator: those that no block claims."""
    names = [value.name for value in pb.ActionType.DESCRIPTOR.values if value.number]
    return tuple(n for n in names if not n.endswith("_PLUGIN") and not _blocks_that_fit(pb.SingleAction, n))


def fitting_blocks(owner: Any) -> tuple[str, ...]:
    """Blocks that fit the type of an action or perception, most common first."""
    _, field, enum = _ONEOFS[type(owner)]
    value = enum.DESCRIPTOR.values_by_number.get(getattr(owner, field))
    name = value.name if value is not None else ""
    kind: Any = type(owner)
    own = _blocks_that_fit(kind, name)
    if isinstance(owner, pb.SinglePerception):
        return (*own, PLUGIN_BLOCK)
    return own or ((PLUGIN_BLOCK,) if name.endswith("_PLUGIN") else tuple(MEMBERS[kind]))


def fitting_types(owner: Any, block_name: str) -> tuple[str, ...]:
    """Names of the action or perception types that a block fits, most common first."""
    message = MEMBERS[type(owner)].get(block_name)
    own = tuple(block_rule(message).fits) if message is not None else ()
    if isinstance(owner, pb.SinglePerception):
        return own
    return (*(("ACTION_PLUGIN",) if block_name == PLUGIN_BLOCK else own), *_roles())


def calibratable_blocks() -> tuple[str, ...]:
    """Actuator blocks to calibrate: wired ones first, then radio, simulation and third parties.

    Devices that are virtual but not simulated have a defined zero and cannot be moved by hand.
    """
    rules = {name: block_rule(message) for name, message in MEMBERS[pb.SingleAction].items()}
    found = [name for name, rule in rules.items() if rule.simulated or not rule.virtual]
    return tuple(
        sorted(found, key=lambda n: (n == PLUGIN_BLOCK, rules[n].simulated, rules[n].link != "serial"))
    )


def messages_of(owner: Any) -> Messages:
    """Message types that the node of an action, perception or model can publish and subscribe to.

    Everything is allowed for a third party's device whose block declares nothing.
    """
    if isinstance(owner, pb.SingleModel):
        return _ANY if owner.HasField(PLUGIN_BLOCK) else _MODEL
    name, _, rule = device_block(owner)
    if name == PLUGIN_BLOCK:
        return _stated(rule, _ANY)
    if isinstance(owner, pb.SingleAction):
        return _stated(rule, _ACTUATOR)
    own = [block for block in fitting_blocks(owner) if block != PLUGIN_BLOCK]
    return _stated(block_rule(MEMBERS[pb.SinglePerception][own[0]]), Messages(None, ())) if own else _ANY


def _stated(rule: options_pb2.BlockRule, otherwise: Messages) -> Messages:
    return Messages(
        tuple(map(types.DataType.Value, rule.publishes)) or otherwise.publishes,
        tuple(map(types.DataType.Value, rule.takes)) or otherwise.takes,
    )


def motor_ids(block: Any) -> list[int] | None:
    """The ids of the motors that a block lists, as on a servo bus; None for a block of another kind."""
    facts = field_facts(block.DESCRIPTOR) if block is not None else ()
    fields = [item.name for item in facts if item.repeated and item.kind == options_pb2.KIND_MOTOR_ID]
    return [number for name in fields for number in getattr(block, name)] if fields else None

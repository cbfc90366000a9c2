"""Verifies what a plugin declares against the schema, before anything of it is used."""

from __future__ import annotations

import difflib
import importlib
import re
from collections.abc import Iterable
from functools import cache

from google.protobuf import descriptor_pool
from google.protobuf.descriptor import EnumDescriptor, FieldDescriptor
from google.protobuf.message import Message

from joshua.plugins.block_values import default_values
from joshua.plugins.specs import (
    ActuatorSpec,
    DeviceSpec,
    EmulatorSpec,
    Environment,
    EnvironmentSpec,
    EpisodeWriterSpec,
    ModelSpec,
    ModeOffer,
    PluginSpec,
    SensorSpec,
    SimulatorSpec,
    StoreSpec,
    TrainerSpec,
    TransportSpec,
)
from joshua.plugins.targets import ROLES
from joshua.schema import config_pb2, simulation_pb2, transport_pb2
from joshua.schema.data_types import type_names
from joshua.schema.rules import block_rule

_IMPORT_STRING = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*:[A-Za-z_]\w*(\.[A-Za-z_]\w*)*")
_MODULE_NAME = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*")
_MESSAGE_NAME = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)+")

#: Modes that the core leaves to plugins.
MODES_OF_PLUGINS = ("MODE_CALIBRATION", "MODE_PLUGIN")


def _message_fields(message: type[Message], without: tuple[str, ...] = ()) -> tuple[str, ...]:
    hidden = {"plugin_config", *without}
    return tuple(
        field.name
        for field in message.DESCRIPTOR.fields
        if field.type == FieldDescriptor.TYPE_MESSAGE and field.name not in hidden
    )


@cache
def _own_blocks() -> dict[str, str]:
    """Action types that fit one block only, with it."""
    fields = config_pb2.SingleAction.DESCRIPTOR.oneofs_by_name["actuator_config"].fields
    return {value: field.name for field in fields for value in block_rule(field.message_type).fits}


@cache
def _blocks() -> dict[type[PluginSpec], tuple[str, ...]]:
    actuators = _message_fields(config_pb2.SingleAction, ("node",))
    sensors = _message_fields(config_pb2.SinglePerception, ("node",))
    return {
        ActuatorSpec: actuators,
        SensorSpec: sensors,
        ModelSpec: _message_fields(config_pb2.SingleModel, ("node",)),
        StoreSpec: ("data_store",),
        TrainerSpec: ("training", *_message_fields(config_pb2.Training)),
        SimulatorSpec: ("simulation",),
        EmulatorSpec: actuators + sensors,
        EnvironmentSpec: ("training",),
        EpisodeWriterSpec: ("data_store",),
        ModeOffer: (),
        TransportSpec: (),
    }


@cache
def _enums() -> dict[type[PluginSpec], tuple[EnumDescriptor, ...]]:
    actions = config_pb2.ActionType.DESCRIPTOR
    perceptions = config_pb2.PerceptionType.DESCRIPTOR
    backends = config_pb2.SimulatorBackend.DESCRIPTOR
    return {
        ActuatorSpec: (actions,),
        SensorSpec: (perceptions,),
        ModelSpec: (config_pb2.ModelType.DESCRIPTOR,),
        StoreSpec: (config_pb2.DataFormat.DESCRIPTOR, config_pb2.StorageBackend.DESCRIPTOR),
        TrainerSpec: (config_pb2.TrainingMethod.DESCRIPTOR, backends),
        SimulatorSpec: (simulation_pb2.SimulationMode.DESCRIPTOR, backends),
        EmulatorSpec: (actions, perceptions),
        EnvironmentSpec: (backends,),
        EpisodeWriterSpec: (config_pb2.DataFormat.DESCRIPTOR,),
        ModeOffer: (config_pb2.OperationMode.DESCRIPTOR,),
        TransportSpec: (transport_pb2.TransportKind.DESCRIPTOR,),
    }


def _kind(spec: PluginSpec) -> type[PluginSpec]:
    """The kind that a spec is of, the base class where its author has chosen none."""
    return next((kind for kind in _blocks() if isinstance(spec, kind)), PluginSpec)


def blocks_of(kind: type[PluginSpec]) -> tuple[str, ...]:
    """Names of the schema's own configuration blocks that a kind may answer for."""
    return _blocks()[kind]


def enum_values_of(kind: type[PluginSpec]) -> tuple[str, ...]:
    """Names of the enum values that a kind may answer for; ``…_UNSPECIFIED`` is never one."""
    return tuple(
        value.name
        for enum in _enums()[kind]
        for value in enum.values
        if not value.name.endswith("UNSPECIFIED")
    )


def verify_specs(specs: Iterable[object]) -> list[str]:
    """Lists what is wrong with what a plugin declares; empty where all is well.

    Imports the message modules of third-party blocks, and nothing else of the plugin.
    """
    problems: list[str] = []
    seen: set[tuple[str, str, str]] = set()
    for number, spec in enumerate(specs):
        if not isinstance(spec, PluginSpec) or not spec.kind:
            problems.append(
                f"joshua_specs: item {number} is {type(spec).__name__}, which is no spec of joshua.plugins; "
                f"allowed: {', '.join(kind.__name__ for kind in _blocks())}"
            )
            continue
        found = [f"spec {number} ({_label(spec)}): {text}" for text in _problems(spec)]
        problems += found
        if found:
            continue
        for value in spec.enum_values or ("",):
            key = (spec.kind, spec.block, value)
            if key in seen:
                problems.append(f"spec {number} ({_label(spec)}): is declared twice")
            seen.add(key)
    return problems


def _label(spec: PluginSpec) -> str:
    return spec.block or "/".join(map(str, spec.enum_values)) or str(spec.implementation)


def _problems(spec: PluginSpec) -> list[str]:
    return [
        *_enum_problems(spec),
        *_block_problems(spec),
        *_import_string_problems(spec),
        *_data_type_problems(spec),
        *_environment_problems(spec),
        *_mode_problems(spec),
        *_transport_problems(spec),
    ]


def _enum_problems(spec: PluginSpec) -> list[str]:
    names: object = spec.enum_values
    if not isinstance(names, tuple):
        return [f"enum_values is {type(names).__name__}, not a tuple of names"]
    known = enum_values_of(_kind(spec))
    problems = [
        f"enum value {value!r} is unknown for {spec.kind}; {_nearest(str(value), known)}"
        for value in spec.enum_values
        if value not in known
    ]
    for value in spec.enum_values:
        own = _own_blocks().get(value)
        if own and spec.block != own:
            problems.append(f"{value} fits only {own}")
        if value.endswith("_PLUGIN") and spec.block in blocks_of(_kind(spec)):
            problems.append(f"{value} fits only a message of the plugin's own")
    return problems


def _block_problems(spec: PluginSpec) -> list[str]:
    block = spec.block
    if not block:
        return [] if spec.enum_values else ["neither block nor enum_values says what asks for it"]
    known = blocks_of(_kind(spec))
    if block in known:
        return []
    if not _MESSAGE_NAME.fullmatch(block):
        return [
            f"block {block!r} is no block of {spec.kind}; {_nearest(block, known)}; "
            "a message of the plugin's own is named in full, such as acme.GripperConfig"
        ]
    if not _MODULE_NAME.fullmatch(spec.message_module):
        return [f"block {block} needs message_module, the _pb2 module that registers it"]
    try:
        importlib.import_module(spec.message_module)
    except Exception as error:  # noqa: BLE001 - code of a third party: whatever it raises is the reason
        return [f"message_module {spec.message_module} fails at import: {type(error).__name__}: {error}"]
    try:
        default_values(descriptor_pool.Default().FindMessageTypeByName(block))
    except KeyError:
        return [f"message_module {spec.message_module} does not register the message {block}"]
    except ValueError as error:
        return [str(error)]
    return []


def _import_string_problems(spec: PluginSpec) -> list[str]:
    texts = {role: getattr(spec, role, "") for role in ROLES}
    return [
        f"{role} is {text!r}, not an import string such as acme.gripper:Gripper"
        for role, text in texts.items()
        if (text or role == "implementation")
        and not (isinstance(text, str) and _IMPORT_STRING.fullmatch(text))
    ]


def _data_type_problems(spec: PluginSpec) -> list[str]:
    types: object = spec.data_types if isinstance(spec, DeviceSpec) else ()
    if not isinstance(types, tuple):
        return [f"data_types is {type(types).__name__}, not a tuple of ROS 2 types"]
    known = type_names()
    return [
        f"data type {name!r} is unknown; {_nearest(str(name), known, 3)}"
        for name in types
        if name not in known
    ]


def _environment_problems(spec: PluginSpec) -> list[str]:
    if not isinstance(spec, EnvironmentSpec):
        return []
    offers: object = spec.environments
    if not isinstance(offers, tuple) or not all(isinstance(offer, Environment) for offer in offers):
        return ["environments is not a tuple of joshua.plugins.Environment"]
    if not offers:
        return ["environments is empty, and it needs at least one joshua.plugins.Environment"]
    return [f"environment {offer.id!r} offers no reward" for offer in offers if not offer.rewards]


def _mode_problems(spec: PluginSpec) -> list[str]:
    if not isinstance(spec, ModeOffer):
        return []
    if len(spec.enum_values) != 1 or spec.enum_values[0] not in MODES_OF_PLUGINS:
        return [f"a mode answers for one of {', '.join(MODES_OF_PLUGINS)}; the core has the others"]
    if (spec.enum_values[0] == "MODE_PLUGIN") != bool(spec.name):
        return ["name is that of a mode with MODE_PLUGIN, which general.plugin_mode chooses by it"]
    return []


def _transport_problems(spec: PluginSpec) -> list[str]:
    if not isinstance(spec, TransportSpec):
        return []
    if len(spec.enum_values) != 1:
        return ["a transport provides one kind"]
    if (spec.enum_values[0] == "TRANSPORT_PLUGIN") != bool(spec.name):
        return ["name belongs to TRANSPORT_PLUGIN, where transport.plugin_kind chooses the transport by it"]
    return []


def _nearest(name: str, known: tuple[str, ...], count: int | None = None) -> str:
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.0)
    ordered = [*near, *(value for value in known if value not in near)]
    return f"allowed: {', '.join(ordered[:count])}" + (", …" if count else "")

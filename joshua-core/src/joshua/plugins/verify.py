"""Verifies what a plugin declares against the schema, before anything of it is used."""

from __future__ import annotations

import difflib
import importlib
import re
from collections.abc import Iterable

from google.protobuf import descriptor_pool
from google.protobuf.descriptor import EnumDescriptor, FieldDescriptor
from google.protobuf.message import Message

from joshua.plugins.block_values import default_values
from joshua.plugins.provision import Environment, Provision, ProvisionKind
from joshua.schema import config_pb2, simulation_pb2
from joshua.schema.data_types import type_names

_IMPORT_STRING = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*:[A-Za-z_]\w*(\.[A-Za-z_]\w*)*")
_MODULE_NAME = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*")
_MESSAGE_NAME = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)+")

# Enum values that fit one block only.
_OWN_BLOCK = {"ACTION_MOCK": "mock_motor_config", "ACTION_SPIKE": "spike_motor_config"}


def _message_fields(message: type[Message], without: tuple[str, ...] = ()) -> tuple[str, ...]:
    hidden = {"plugin_config", *without}
    return tuple(
        field.name
        for field in message.DESCRIPTOR.fields
        if field.type == FieldDescriptor.TYPE_MESSAGE and field.name not in hidden
    )


def blocks_of(kind: ProvisionKind) -> tuple[str, ...]:
    """Names of the schema's own configuration blocks that a kind may answer for."""
    actuators = _message_fields(config_pb2.SingleAction, ("node",))
    sensors = _message_fields(config_pb2.SinglePerception, ("node",))
    return {
        ProvisionKind.ACTUATOR: actuators,
        ProvisionKind.SENSOR: sensors,
        ProvisionKind.MODEL: _message_fields(config_pb2.SingleModel, ("node",)),
        ProvisionKind.STORE: ("data_store",),
        ProvisionKind.TRAINER: ("training", *_message_fields(config_pb2.Training)),
        ProvisionKind.SIMULATOR: ("simulation",),
        ProvisionKind.EMULATOR: actuators + sensors,
        ProvisionKind.ENVIRONMENT: ("training",),
        ProvisionKind.EPISODE_WRITER: ("data_store",),
    }[kind]


def enum_values_of(kind: ProvisionKind) -> tuple[str, ...]:
    """Names of the enum values that a kind may answer for; ``…_UNSPECIFIED`` is never one."""
    actions = config_pb2.ActionType.DESCRIPTOR
    perceptions = config_pb2.PerceptionType.DESCRIPTOR
    backends = config_pb2.SimulatorBackend.DESCRIPTOR
    enums: tuple[EnumDescriptor, ...] = {
        ProvisionKind.ACTUATOR: (actions,),
        ProvisionKind.SENSOR: (perceptions,),
        ProvisionKind.MODEL: (config_pb2.ModelType.DESCRIPTOR,),
        ProvisionKind.STORE: (config_pb2.DataFormat.DESCRIPTOR, config_pb2.StorageBackend.DESCRIPTOR),
        ProvisionKind.TRAINER: (config_pb2.TrainingMethod.DESCRIPTOR, backends),
        ProvisionKind.SIMULATOR: (simulation_pb2.SimulationMode.DESCRIPTOR, backends),
        ProvisionKind.EMULATOR: (actions, perceptions),
        ProvisionKind.ENVIRONMENT: (backends,),
        ProvisionKind.EPISODE_WRITER: (config_pb2.DataFormat.DESCRIPTOR,),
    }[kind]
    return tuple(
        value.name for enum in enums for value in enum.values if not value.name.endswith("UNSPECIFIED")
    )


def verify_provisions(provisions: Iterable[object]) -> list[str]:
    """Lists what is wrong with a plugin's provisions; empty where all is well.

    Imports the message modules of third-party blocks, and nothing else of the plugin.
    """
    problems: list[str] = []
    seen: set[tuple[str, str, str]] = set()
    for number, provision in enumerate(provisions):
        if not isinstance(provision, Provision):
            problems.append(
                f"joshua_provisions: item {number} is {type(provision).__name__}, "
                "not joshua.plugins.Provision"
            )
            continue
        found = [f"provision {number} ({_label(provision)}): {text}" for text in _problems(provision)]
        problems += found
        if found:
            continue
        for value in provision.enum_values or ("",):
            key = (str(provision.kind), provision.block, value)
            if key in seen:
                problems.append(f"provision {number} ({_label(provision)}): is declared twice")
            seen.add(key)
    return problems


def _label(provision: Provision) -> str:
    return provision.block or "/".join(map(str, provision.enum_values)) or str(provision.implementation)


def _problems(provision: Provision) -> list[str]:
    kind: object = provision.kind  # a plugin's author may have written anything
    if not isinstance(kind, ProvisionKind):
        return [f"kind is {kind!r}, not a joshua.plugins.ProvisionKind"]
    return [
        *_enum_problems(provision),
        *_block_problems(provision),
        *_import_string_problems(provision),
        *_data_type_problems(provision),
        *_environment_problems(provision),
    ]


def _enum_problems(provision: Provision) -> list[str]:
    names: object = provision.enum_values
    if not isinstance(names, tuple):
        return [f"enum_values is {type(names).__name__}, not a tuple of names"]
    known = enum_values_of(provision.kind)
    problems = [
        f"enum value {value!r} is unknown for {provision.kind.value}; {_nearest(str(value), known)}"
        for value in provision.enum_values
        if value not in known
    ]
    for value in provision.enum_values:
        own = _OWN_BLOCK.get(value)
        if own and provision.block != own:
            problems.append(f"{value} fits only {own}")
        if value.endswith("_PLUGIN") and provision.block in blocks_of(provision.kind):
            problems.append(f"{value} fits only a message of the plugin's own")
    return problems


def _block_problems(provision: Provision) -> list[str]:
    block = provision.block
    if not block:
        return [] if provision.enum_values else ["neither block nor enum_values says what asks for it"]
    known = blocks_of(provision.kind)
    if block in known:
        return []
    if not _MESSAGE_NAME.fullmatch(block):
        return [
            f"block {block!r} is no block of {provision.kind.value}; {_nearest(block, known)}; "
            "a message of the plugin's own is named in full, such as acme.GripperConfig"
        ]
    if not _MODULE_NAME.fullmatch(provision.message_module):
        return [f"block {block} needs message_module, the _pb2 module that registers it"]
    try:
        importlib.import_module(provision.message_module)
    except Exception as error:  # noqa: BLE001 - code of a third party: whatever it raises is the reason
        return [f"message_module {provision.message_module} fails at import: {type(error).__name__}: {error}"]
    try:
        default_values(descriptor_pool.Default().FindMessageTypeByName(block))
    except KeyError:
        return [f"message_module {provision.message_module} does not register the message {block}"]
    except ValueError as error:
        return [str(error)]
    return []


def _import_string_problems(provision: Provision) -> list[str]:
    texts = {
        "implementation": provision.implementation,
        "settings": provision.settings,
        "behaviour": provision.behaviour,
        "native": provision.native,
        "safe_stop": provision.safe_stop,
        "bus_tools": provision.bus_tools,
        "packaged_files": provision.packaged_files,
        "stand_in": provision.stand_in,
    }
    return [
        f"{name} is {text!r}, not an import string such as acme.gripper:Gripper"
        for name, text in texts.items()
        if (text or name == "implementation")
        and not (isinstance(text, str) and _IMPORT_STRING.fullmatch(text))
    ]


def _data_type_problems(provision: Provision) -> list[str]:
    types: object = provision.data_types
    if not isinstance(types, tuple):
        return [f"data_types is {type(types).__name__}, not a tuple of ROS 2 types"]
    known = type_names()
    return [
        f"data type {name!r} is unknown; {_nearest(str(name), known, 3)}"
        for name in types
        if name not in known
    ]


def _environment_problems(provision: Provision) -> list[str]:
    offers: object = provision.environments
    if not isinstance(offers, tuple) or not all(isinstance(offer, Environment) for offer in offers):
        return ["environments is not a tuple of joshua.plugins.Environment"]
    if bool(offers) != (provision.kind is ProvisionKind.ENVIRONMENT):
        return ["environments belong to a provision of kind ENVIRONMENT, which has at least one"]
    return [
        f"environment {offer.id!r} offers no reward" for offer in provision.environments if not offer.rewards
    ]


def _nearest(name: str, known: tuple[str, ...], count: int | None = None) -> str:
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.0)
    ordered = [*near, *(value for value in known if value not in near)]
    return f"allowed: {', '.join(ordered[:count])}" + (", …" if count else "")

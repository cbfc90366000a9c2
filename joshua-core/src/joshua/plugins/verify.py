"""Verifies the declarations of a plugin against the schema, before use."""

from __future__ import annotations

import importlib
import re
from collections.abc import Iterable
from functools import cache
from typing import Any

from google.protobuf import descriptor_pool

from joshua.plugins import specs as kinds
from joshua.plugins.block_values import default_values
from joshua.plugins.specs import (
    DeviceSpec,
    Environment,
    EnvironmentSpec,
    ModeOffer,
    PluginSpec,
    TransportSpec,
)
from joshua.plugins.targets import ROLES
from joshua.schema import config_pb2 as pb
from joshua.schema import simulation_pb2, transport_pb2
from joshua.schema.data_types import type_names
from joshua.schema.rules import block_rule

_NAME = r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*"
_IMPORT_STRING = re.compile(f"{_NAME}:{_NAME}")
_MESSAGE_NAME = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)+")

#: Modes that plugins provide.
MODES_OF_PLUGINS = ("MODE_CALIBRATION", "MODE_PLUGIN")


def _message_fields(message: Any) -> tuple[str, ...]:
    fields = message.DESCRIPTOR.fields
    hidden = ("plugin_config", "node", "execution", "compute", "rename")
    return tuple(field.name for field in fields if field.message_type and field.name not in hidden)


@cache
def _own_blocks() -> dict[str, str]:
    """Action types with only one block, and that block."""
    fields = pb.SingleAction.DESCRIPTOR.oneofs_by_name["actuator_config"].fields
    return {value: field.name for field in fields for value in block_rule(field.message_type).fits}


@cache
def _answerable() -> dict[type[PluginSpec], tuple[tuple[str, ...], tuple[str, ...]]]:
    """The schema's blocks and enum values allowed for each kind, without ``…_UNSPECIFIED``."""
    actuators, sensors = _message_fields(pb.SingleAction), _message_fields(pb.SinglePerception)
    actions, perceptions, backends = pb.ActionType, pb.PerceptionType, pb.SimulatorBackend
    table: dict[type[PluginSpec], tuple[tuple[str, ...], tuple[Any, ...]]] = {
        kinds.ActuatorSpec: (actuators, (actions,)),
        kinds.SensorSpec: (sensors, (perceptions,)),
        kinds.ModelSpec: (_message_fields(pb.SingleModel), (pb.ModelType,)),
        kinds.StoreSpec: (("data_store",), (pb.DataFormat, pb.StorageBackend)),
        kinds.TrainerSpec: (("training", *_message_fields(pb.Training)), (pb.TrainingMethod, backends)),
        kinds.SimulatorSpec: (("simulation",), (simulation_pb2.SimulationMode, backends)),
        kinds.EmulatorSpec: (actuators + sensors, (actions, perceptions)),
        EnvironmentSpec: (("training",), (backends,)),
        kinds.EpisodeWriterSpec: (("data_store",), (pb.DataFormat,)),
        ModeOffer: ((), (pb.OperationMode,)),
        kinds.ExtensionSpec: ((), ()),
        TransportSpec: ((), (transport_pb2.TransportKind,)),
    }
    return {
        kind: (blocks, tuple(value for enum in enums for value in _chosen(enum)))
        for kind, (blocks, enums) in table.items()
    }


def _chosen(enum: Any) -> list[str]:
    return [name for name in enum.DESCRIPTOR.values_by_name if not name.endswith("UNSPECIFIED")]


def _answerable_by(spec: PluginSpec) -> tuple[tuple[str, ...], tuple[str, ...]]:
    return next(known for kind, known in _answerable().items() if isinstance(spec, kind))


def verify_specs(specs: Iterable[object]) -> list[str]:
    """List the problems of a plugin's declarations.

    Imports only the message modules of third-party blocks.
    """
    problems: list[str] = []
    seen: set[tuple[str, str, str]] = set()
    for number, spec in enumerate(specs):
        if not isinstance(spec, PluginSpec) or not spec.kind:
            problems.append(
                f"joshua_specs: item {number} is {type(spec).__name__}, which is not a spec of joshua.api; "
                f"allowed: {', '.join(kind.__name__ for kind in _answerable())}"
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
    problems = [*_enum_problems(spec), *_block_problems(spec)]
    for role in ROLES:
        text: object = getattr(spec, role, "")
        is_import_string = isinstance(text, str) and _IMPORT_STRING.fullmatch(text)
        if (text or role == "implementation") and not is_import_string:
            problems.append(f"{role} is {text!r}, not an import string such as acme.gripper:Gripper")
    if isinstance(spec, DeviceSpec):
        problems += _data_type_problems(spec.data_types)
    if isinstance(spec, EnvironmentSpec):
        problems += _environment_problems(spec.environments)
    if isinstance(spec, ModeOffer):
        problems += _mode_problems(spec)
    return problems + (_transport_problems(spec) if isinstance(spec, TransportSpec) else [])


def _enum_problems(spec: PluginSpec) -> list[str]:
    names: object = spec.enum_values
    if not isinstance(names, tuple):
        return [f"enum_values is {type(names).__name__}, not a tuple of names"]
    blocks, known = _answerable_by(spec)
    problems = [
        f"enum value {value!r} is unknown for {spec.kind}; {_nearest(str(value), known)}"
        for value in spec.enum_values
        if value not in known
    ]
    for value in spec.enum_values:
        own = _own_blocks().get(value)
        if own and spec.block != own:
            problems.append(f"{value} fits only {own}")
        if value.endswith("_PLUGIN") and spec.block in blocks:
            problems.append(f"{value} fits only a message of the plugin's own")
    return problems


def _block_problems(spec: PluginSpec) -> list[str]:
    block = spec.block
    if not block:
        asked = spec.enum_values or isinstance(spec, kinds.ExtensionSpec)
        return [] if asked else ["neither block nor enum_values says what asks for it"]
    known, _ = _answerable_by(spec)
    if block in known:
        return []
    if not _MESSAGE_NAME.fullmatch(block):
        return [
            f"block {block!r} is not a block of {spec.kind}; {_nearest(block, known)}; "
            "a message of the plugin's own is named in full, such as acme.GripperConfig"
        ]
    if not re.fullmatch(_NAME, spec.message_module):
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


def _data_type_problems(types: object) -> list[str]:
    if not isinstance(types, tuple):
        return [f"data_types is {type(types).__name__}, not a tuple of ROS 2 types"]
    known = type_names()
    return [f"data type {n!r} is unknown; {_nearest(str(n), known, 3)}" for n in types if n not in known]


def _environment_problems(offers: object) -> list[str]:
    if not isinstance(offers, tuple) or not all(isinstance(offer, Environment) for offer in offers):
        return ["environments is not a tuple of joshua.api.simulation.Environment"]
    if not offers:
        return ["environments is empty, and it needs at least one joshua.api.simulation.Environment"]
    return [f"environment {offer.id!r} offers no reward" for offer in offers if not offer.rewards]


def _mode_problems(spec: ModeOffer) -> list[str]:
    if len(spec.enum_values) != 1 or spec.enum_values[0] not in MODES_OF_PLUGINS:
        return [f"a mode answers for one of {', '.join(MODES_OF_PLUGINS)}; the core has the others"]
    if (spec.enum_values[0] == "MODE_PLUGIN") != bool(spec.name):
        return ["MODE_PLUGIN, and no other mode, needs a name: general.plugin_mode chooses the mode by it"]
    return []


def _transport_problems(spec: TransportSpec) -> list[str]:
    if len(spec.enum_values) != 1:
        return ["a transport provides one kind"]
    if (spec.enum_values[0] == "TRANSPORT_PLUGIN") != bool(spec.name):
        return ["name belongs to TRANSPORT_PLUGIN, where transport.plugin_kind chooses the transport by it"]
    return []


def _nearest(name: str, known: tuple[str, ...], count: int | None = None) -> str:
    import difflib  # slow, so only for errors

    near = difflib.get_close_matches(name, known, n=1, cutoff=0.0)
    ordered = [*near, *(value for value in known if value not in near)]
    return f"allowed: {', '.join(ordered[:count])}" + (", …" if count else "")

"""From the device and model blocks of a file to the implementations and settings that run them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from joshua.config.checks.blocks import unpacked
from joshua.config.checks.device_table import value_name
from joshua.plan.graph import NodeEntry, RobotGraph
from joshua.plan.joints import JointRange
from joshua.plugins import ActuatorSpec, ModelSpec, NodePluginSpec, SensorSpec
from joshua.schema import config_pb2 as pb
from joshua.schema.rules import block_rule


@dataclass(frozen=True, eq=False, repr=False)
class Wanted:
    """One node that the mode starts: its entry in the file, and what its implementation is asked by.

    Attributes:
        block_name: member of the oneof, or the full message name of an ``Any`` block; "" where none is set.
        block: the block's message, unpacked; None where none is set.
        block_path: field path of the block.
        enum_value: name such as ``PERCEPTION_LIDAR``.
    """

    entry: NodeEntry
    kind: type[NodePluginSpec]
    block_name: str
    block: Any
    block_path: str
    enum_value: str

    @property
    def is_simulated(self) -> bool:
        """Whether the device is part of the simulated model."""
        return self.block is not None and block_rule(self.block.DESCRIPTOR).simulated


def wanted_nodes(graph: RobotGraph, *, devices: bool, models: bool) -> list[Wanted]:
    """Lists the nodes that a mode starts, in the order of the file; a replay takes the place of leaders."""
    return [
        _wanted(entry)
        for entry in graph.entries
        if (models if entry.is_model else devices) and not (graph.replays and entry.leads)
    ]


def _wanted(entry: NodeEntry) -> Wanted:
    owner = entry.owner
    if entry.is_actuator:
        name = owner.WhichOneof("actuator_config") or ""
        enum_value = value_name(pb.ActionType, owner.action_type)
        kind: type[NodePluginSpec] = ActuatorSpec
    elif entry.is_sensor:
        name = owner.WhichOneof("device_config") or ""
        enum_value = value_name(pb.PerceptionType, owner.perception_type)
        kind = SensorSpec
    else:
        name = next((n for n in ("plugin_config", "random_noise_config") if owner.HasField(n)), "")
        if not name and owner.model_type == pb.RANDOM_NOISE:
            name = "random_noise_config"  # omitted, it means its defaults
        enum_value = value_name(pb.ModelType, owner.model_type)
        kind = ModelSpec
    path = f"{entry.owner_path}.{name}" if name else entry.owner_path
    block = getattr(owner, name) if name else (owner if kind is ModelSpec else None)
    if name == "plugin_config":
        name, block = unpack(block)
    return Wanted(entry, kind, name, block, path, enum_value)


def unpack(block: Any) -> tuple[str, Any]:
    """Opens an ``Any`` block: full message name, and the message or None where its type is unknown."""
    return block.type_url.rpartition("/")[2], unpacked(block)


def joints_of(settings: Any) -> tuple[JointRange, ...]:
    """The joints of an actuator, as its settings know them without a connection; () where they do not."""
    if settings is None:
        return ()
    from joshua.plugins.settings import ActuatorSettings  # needs pydantic, as the settings did

    return settings.joints() if isinstance(settings, ActuatorSettings) else ()

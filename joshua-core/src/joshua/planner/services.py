"""Service nodes: the data store, the trainer and the simulator that a mode runs beside the devices."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from joshua.config.checks.device_table import value_name
from joshua.config.graph import offered_profile
from joshua.config.input_paths import folder_of
from joshua.modes import ServiceSpec
from joshua.modes.services import makes_episodes
from joshua.plan.graph import GraphService, RobotGraph, ServiceTopic
from joshua.plan.qos import QosProfile
from joshua.planner.environments import choose_environment
from joshua.plugins import EpisodeWriterSpec, PluginSpec, SimulatorSpec, StoreSpec, TrainerSpec
from joshua.plugins.block_context import BlockContext, DataStoreContext
from joshua.schema import config_pb2 as pb

if TYPE_CHECKING:
    from joshua.plan import ChosenEnvironment, Diagnostic, NodeSpec, TopicSpec
    from joshua.planner.draft import Draft


@dataclass(frozen=True, eq=False, repr=False)
class ResolvedService:
    """A service of the mode with the plugin spec of its implementation.

    Attributes:
        block: the part of its block that the mode uses; enum_value: the value that selects the plugin.
        plugin: distribution of its implementation.
        settings: the checked settings model; None if the plugin declares none.
        folder: to which paths are relative; environment: of a trainer.
    """

    service: ServiceSpec
    block: Any
    enum_value: str
    spec: PluginSpec
    plugin: str
    settings: Any
    folder: str
    environment: ChosenEnvironment | None = None


def resolve_services(draft: Draft) -> list[ResolvedService]:
    """Find the implementations of the mode's services and add them to the graph. Problems become findings."""
    config, registry, mode = draft.config, draft.registry, draft.mode
    chosen = choose_environment(draft) if mode.uses("ai.training") else None
    resolved = []
    for service in mode.services:
        block, value = service.block(config), service.value(config)
        spec: PluginSpec | None
        if service.behaviour:  # the plugin of the mode provides the service
            value, spec = mode.name, PluginSpec(implementation=service.behaviour, settings=service.settings)
            offer = registry.modes().get(mode.name)
            owner = registry.owner(offer).distribution if offer is not None else "joshua-core"
        elif block is None or service.kind is None:
            continue
        else:
            spec = registry.find(service.kind, service.block_name, value)
            if spec is None:
                if service.is_chosen(config):  # otherwise a check reports the choices
                    draft.findings.append(
                        _missing(draft, service.path, service.kind, value, service.required)
                    )
                continue
            owner = registry.owner(spec).distribution
        folder, store = _folder(draft, service.path), DataStoreContext()
        if service.kind in (SimulatorSpec, TrainerSpec) and config.ai.HasField("data_store"):
            store = _data_store(draft)
        settings = draft.settings(
            spec, block, service.path, BlockContext(folder=folder, data_store=store, launch=draft.launch)
        )
        environment = chosen if service.kind is TrainerSpec else None
        resolved.append(ResolvedService(service, block, value, spec, owner, settings, folder, environment))
    draft.graph = draft.graph.with_services(
        GraphService(item.service.name, item.service.path, tuple(item.service.topics(draft.graph, config)))
        for item in resolved
    )
    return resolved


def _missing(draft: Draft, path: str, kind: type[PluginSpec], value: str, required: bool) -> Diagnostic:
    """Report a service block whose plugin is not installed, as an error if the mode requires it."""
    block = path.rpartition(".")[2]
    sentence = draft.registry.missing(block, kind, block, value)
    remedy = "Install the plugin" if draft.launch else "Install it before the launch"
    if required:
        return draft.missing("plugin-missing", sentence, path, remedy=remedy)
    make = draft.warning if draft.launch else draft.note
    remedy = f"Install the plugin, or remove the {block} block"
    return make("plugin-missing", f"{sentence}; the run continues without it", path, remedy=remedy)


def _data_store(draft: Draft) -> DataStoreContext:
    """Facts about the data set for a trainer, and for a simulator that replays or makes episodes."""
    block, path = draft.config.ai.data_store, "ai.data_store"
    value = value_name(pb.DataFormat, block.format)
    writer = draft.registry.find(EpisodeWriterSpec, "data_store", value)
    if writer is None and makes_episodes(draft.config):
        draft.findings.append(_missing(draft, path, EpisodeWriterSpec, value, required=True))
    folder = _folder(draft, f"{path}.local_path")
    local = str(Path(folder) / os.path.expanduser(block.local_path))  # noqa: PTH111 (as the checks)
    return DataStoreContext(
        writer=writer.implementation if writer else "",
        task=block.task or block.dataset_name,
        robot_type=draft.config.general.robot_type,
        path=local if block.local_path else "",
        episodes=tuple(block.episodes),
        format=value,
    )


def _folder(draft: Draft, path: str) -> str:
    return str(folder_of(draft.loaded.positions, path, draft.request.path))


def physics_of(services: Iterable[ResolvedService]) -> dict[str, Any] | None:
    """Settings of the simulation of the devices; None if there is none."""
    for resolved in services:
        if resolved.service.kind is SimulatorSpec and resolved.settings is not None:
            return dict(resolved.settings.model_dump(mode="json"))
    return None


def service_node(draft: Draft, resolved: ResolvedService, told: Mapping[str, Any]) -> NodeSpec:
    """Make the node spec of a service.

    Args:
        told: facts for a data store about the robot.
    """
    from google.protobuf import json_format

    from joshua.plan import NodeKind, NodeSpec, ServiceFacts

    service, spec, settings, graph = resolved.service, resolved.spec, resolved.settings, draft.graph
    if settings is not None:
        values = settings.model_dump(mode="json")
    elif resolved.block is not None:
        values = json_format.MessageToDict(resolved.block, preserving_proto_field_name=True)
    else:
        values = {}
    topics = next(item.topics for item in graph.services if item.name == service.name)
    facts = ServiceFacts(
        folder=resolved.folder,
        configuration=_text(draft.config) if service.kind is TrainerSpec else "",
        physics_socket=draft.request.physics_socket if service.kind is SimulatorSpec else "",
        environment=resolved.environment,
        ready_timeout_s=getattr(settings, "ready_timeout_s", 0.0),
        stop_timeout_s=getattr(settings, "stop_timeout_s", 0.0),
        **(told if service.kind is StoreSpec else {}),
    )
    if service.kind is StoreSpec and not getattr(spec, "all_topics", False):
        recorded = {feature.topic for feature in facts.features}
        topics = tuple(item for item in topics if item.is_publisher or item.name in recorded)
    return NodeSpec(
        name=service.name,
        kind=NodeKind.SERVICE,
        role=resolved.enum_value,
        block=service.block_name,
        plugin=resolved.plugin,
        behaviour=spec.implementation,
        implementation=spec.implementation,
        settings_type=spec.settings,
        settings=values,
        facts=facts,
        publishers=tuple(_topic(item, graph) for item in topics if item.is_publisher),
        subscriptions=tuple(_topic(item, graph) for item in topics if not item.is_publisher),
        process_group=service.process_group,
        restart=service.restart,
    )


def _text(config: Any) -> str:
    """The configuration in one file: what was included is part of the message."""
    whole = type(config)()
    whole.CopyFrom(config)
    whole.ClearField("include")
    return str(whole)


def _topic(item: ServiceTopic, graph: RobotGraph) -> TopicSpec:
    from joshua.plan import TopicSpec

    qos = item.qos or (QosProfile() if item.is_publisher else offered_profile(graph, item.name))
    return TopicSpec(name=item.name, type_name=item.type_name, qos=qos, rate_hz=item.rate_hz)

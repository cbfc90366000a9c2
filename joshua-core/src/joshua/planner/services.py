"""Service nodes: the data store, the trainer and the simulator that a mode runs beside the devices."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from joshua.config.graph import offered_profile
from joshua.modes import ModeSpec, ServiceSpec
from joshua.modes.services import makes_episodes
from joshua.plan.graph import GraphService, RobotGraph, ServiceTopic
from joshua.plan.qos import QosProfile
from joshua.planner.diagnostics import Diagnostics
from joshua.planner.environments import choose_environment
from joshua.planner.request import Request
from joshua.plugins import EpisodeWriterSpec, PluginSpec, Registry, SimulatorSpec, TrainerSpec
from joshua.plugins.block_context import BlockContext, DataStoreContext
from joshua.schema import config_pb2 as pb

if TYPE_CHECKING:
    from joshua.plan import ChosenEnvironment, NodeSpec, TopicSpec


@dataclass(frozen=True)
class ResolvedService:
    """A service of the mode with the plugin spec that runs it.

    Attributes:
        block: the block that asks for it, as far as the mode uses it; enum_value: what chose the plugin.
        plugin: distribution that provides it.
        settings: the checked settings model; None where the plugin declares none.
        folder: at which relative paths start; environment: that a trainer learns in.
    """

    service: ServiceSpec
    block: Any
    enum_value: str
    spec: PluginSpec
    plugin: str
    settings: Any
    folder: str
    environment: ChosenEnvironment | None = None


def resolve_services(
    config: pb.Config, registry: Registry, mode: ModeSpec, findings: Diagnostics, request: Request
) -> list[ResolvedService]:
    """Finds what runs the services of a mode, and checks their settings; problems become findings.

    Args:
        request: names the configuration file, at whose folder relative paths start.
    """
    source = request.path
    resolved = []
    chosen = choose_environment(config, registry, findings) if mode.uses("ai.training") else None
    for service in mode.services:
        block = service.block(config)
        if service.behaviour:
            resolved.append(_own(service, block, mode, registry, findings, source))
            continue
        if block is None or service.kind is None:
            continue
        value = service.value(config)
        spec = registry.find(service.kind, service.path.rpartition(".")[2], value)
        if spec is None:
            if service.is_chosen(config):  # else a check says what to choose
                findings.service_missing(
                    service.path, service.kind, value, registry, required=service.required
                )
            continue
        folder, store = _folder(service.path, findings, source), DataStoreContext()
        if service.kind is SimulatorSpec and config.ai.HasField("data_store"):
            beside = _folder("ai.data_store.local_path", findings, source)
            store = _data_store(config, registry, findings, beside)
        context = BlockContext(folder=folder, data_store=store, launch=findings.launch)
        settings = _settings(service, block, spec, context, findings)
        owner = registry.owner(spec).distribution
        environment = chosen if service.kind is TrainerSpec else None
        resolved.append(ResolvedService(service, block, value, spec, owner, settings, folder, environment))
    return resolved


def _own(
    service: ServiceSpec, block: Any, mode: ModeSpec, registry: Registry, findings: Diagnostics, source: str
) -> ResolvedService:
    """A service that the plugin of the mode brings itself."""
    spec = PluginSpec(implementation=service.behaviour, settings=service.settings)
    context = BlockContext(folder=_folder(service.path, findings, source), launch=findings.launch)
    offer = registry.modes().get(mode.name)
    owner = registry.owner(offer).distribution if offer is not None else "joshua-core"
    settings = _settings(service, block, spec, context, findings) if block is not None else None
    return ResolvedService(service, block, mode.name, spec, owner, settings, context.folder)


def _settings(
    service: ServiceSpec, block: Any, spec: PluginSpec, context: BlockContext, findings: Diagnostics
) -> Any:
    if not spec.settings:
        return None
    from joshua.plugins.settings import make_settings

    settings, problems = make_settings(
        spec,
        block,
        context=context,
        field_path=service.path,
        positions=findings.positions,
    )
    findings.items += problems
    return settings


def _data_store(
    config: pb.Config, registry: Registry, findings: Diagnostics, folder: str
) -> DataStoreContext:
    """What a simulator that replays or makes episodes must know of the data set."""
    block = config.ai.data_store
    path = block.local_path
    value = _name(pb.DataFormat, block.format)
    writer = registry.find(EpisodeWriterSpec, "data_store", value)
    if writer is None and makes_episodes(config):
        findings.service_missing("ai.data_store", EpisodeWriterSpec, value, registry, required=True)
    return DataStoreContext(
        writer=writer.implementation if writer else "",
        task=block.task or block.dataset_name,
        robot_type=config.general.robot_type,
        path=str(Path(folder) / os.path.expanduser(path)) if path else "",  # noqa: PTH111 (as the checks)
        episodes=tuple(block.episodes),
        format=value,
    )


def _folder(path: str, findings: Diagnostics, source: str) -> str:
    """Folder of the file that holds a block or field."""
    position = findings.positions.value(path)
    named_in = position.file if position is not None and Path(position.file).is_file() else source
    return str(Path(named_in).absolute().parent)


def physics_of(services: list[ResolvedService]) -> dict[str, Any] | None:
    """Settings of the simulation that simulated devices are part of; None where there is none."""
    for resolved in services:
        if resolved.service.kind is SimulatorSpec and resolved.settings is not None:
            return dict(resolved.settings.model_dump(mode="json"))
    return None


def graph_services(resolved: Iterable[ResolvedService], graph: RobotGraph, config: pb.Config) -> RobotGraph:
    """Puts the services of a mode into the graph, with their topics."""
    return graph.with_services(
        GraphService(item.service.name, item.service.path, tuple(item.service.topics(graph, config)))
        for item in resolved
    )


def service_node(resolved: ResolvedService, graph: RobotGraph, request: Request) -> NodeSpec:
    """Makes the node spec of a service."""
    from google.protobuf import json_format

    from joshua.plan import NodeKind, NodeSpec, ServiceFacts

    service, spec, settings = resolved.service, resolved.spec, resolved.settings
    values = {}
    if resolved.block is not None:
        values = json_format.MessageToDict(resolved.block, preserving_proto_field_name=True)
    facts = ServiceFacts(
        folder=resolved.folder,
        physics_socket=request.physics_socket if service.kind is SimulatorSpec else "",
        environment=resolved.environment,
    )
    topics = next(item.topics for item in graph.services if item.name == service.name)
    return NodeSpec(
        name=service.name,
        kind=NodeKind.SERVICE,
        role=resolved.enum_value,
        block=service.path.rpartition(".")[2],
        plugin=resolved.plugin,
        behaviour=spec.implementation,
        implementation=spec.implementation,
        settings_type=spec.settings,
        settings=values if settings is None else settings.model_dump(mode="json"),
        facts=facts,
        publishers=tuple(_topic(item, graph) for item in topics if item.is_publisher),
        subscriptions=tuple(_topic(item, graph) for item in topics if not item.is_publisher),
        process_group=service.process_group,
        restart=service.restart,
    )


def _topic(item: ServiceTopic, graph: RobotGraph) -> TopicSpec:
    from joshua.plan import TopicSpec

    qos = item.qos or (QosProfile() if item.is_publisher else offered_profile(graph, item.name))
    return TopicSpec(name=item.name, type_name=item.type_name, qos=qos, rate_hz=item.rate_hz)


def _name(enum: Any, number: int) -> str:
    return str(enum.Name(number)) if number in enum.values() else str(number)

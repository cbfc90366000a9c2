"""Service nodes: the data store, the trainer and the simulator that a mode runs beside the devices."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from joshua.modes.share import ModeShare, Need
from joshua.planner.environments import choose_environment
from joshua.planner.findings import Findings
from joshua.planner.request import Request
from joshua.plugins import EpisodeWriterSpec, Registry, SimulatorSpec, StoreSpec, TrainerSpec
from joshua.schema import config_pb2 as pb
from joshua.schema import simulation_pb2

if TYPE_CHECKING:
    from joshua.plan import NodeSpec


ServiceSpec = StoreSpec | TrainerSpec | SimulatorSpec

#: The process in which one physics stands for any number of devices.
PHYSICS_GROUP = "simulation"

#: Blocks of devices that are part of the simulated model.
PHYSICS_BLOCKS = ("sim_config", "sim_camera_config")


@dataclass(frozen=True)
class Service:
    """A service block that stands in the file, and what its plugin is asked by."""

    path: str
    kind: type[ServiceSpec]
    block: Any
    enum_value: str

    @property
    def name(self) -> str:
        """Name of the block, which becomes the node's name."""
        return self.path.rpartition(".")[2]

    @property
    def is_chosen(self) -> bool:
        """Whether the file says which plugin is meant."""
        if self.kind is TrainerSpec and self.enum_value == "METHOD_RL":
            return bool(self.block.environment == pb.ENV_REAL)  # else its simulator decides
        return not self.enum_value.endswith("_UNSPECIFIED")


@dataclass(frozen=True)
class ResolvedService:
    """A service block with the spec that runs it.

    Attributes:
        settings: the checked settings model; None where the plugin declares none.
        context: further facts for the service, such as the folder at which relative paths start.
    """

    service: Service
    spec: ServiceSpec
    settings: Any
    context: dict[str, Any]


def resolve_services(
    config: pb.Config, registry: Registry, share: ModeShare, findings: Findings, request: Request
) -> list[ResolvedService]:
    """Finds what runs the service blocks of a mode, and checks their settings; problems become findings.

    Args:
        request: names the configuration file, at whose folder relative paths start.
    """
    source = request.path
    resolved = []
    chosen = choose_environment(config, registry, findings) if "training" in share.services else None
    for service in _present(config, share):
        spec = registry.find(service.kind, service.name, service.enum_value)
        if spec is None and not service.is_chosen:
            continue  # the check says what to choose
        if spec is None:
            required = share.services[service.name] is Need.REQUIRED
            findings.service_missing(
                service.path, service.kind, service.enum_value, registry, required=required
            )
        else:
            context: dict[str, Any] = {"folder": _folder(service.path, findings, source)}
            if request.physics_socket and service.kind is SimulatorSpec:
                context["physics_socket"] = request.physics_socket
            if service.kind is SimulatorSpec and config.ai.HasField("data_store"):
                folder = _folder("ai.data_store.local_path", findings, source)
                context["data_store"] = _data_store(config, registry, findings, folder)
            if service.kind is TrainerSpec and chosen is not None:
                context["environment"] = chosen.as_context()
            settings = _settings(service, spec, context, findings)
            resolved.append(ResolvedService(service, spec, settings, context))
    return resolved


def _settings(service: Service, spec: ServiceSpec, context: dict[str, Any], findings: Findings) -> Any:
    if not spec.settings:
        return None
    from joshua.plugins.settings import make_settings

    settings, problems = make_settings(
        spec,
        service.block,
        context=context | {"launch": findings.launch},
        field_path=service.path,
        positions=findings.positions,
    )
    findings.items += problems
    return settings


def _data_store(config: pb.Config, registry: Registry, findings: Findings, folder: str) -> dict[str, Any]:
    """What a simulator that replays or makes episodes must know of the data set."""
    block = config.ai.data_store
    path = block.local_path
    value = _name(pb.DataFormat, block.format)
    writer = registry.find(EpisodeWriterSpec, "data_store", value)
    if writer is None and makes_episodes(config):
        findings.service_missing("ai.data_store", EpisodeWriterSpec, value, registry, required=True)
    return {
        "writer": writer.implementation if writer else "",
        "task": block.task or block.dataset_name,
        "robot_type": config.general.robot_type,
        "path": str(Path(folder) / os.path.expanduser(path)) if path else "",  # noqa: PTH111 (as the checks)
        "episodes": list(block.episodes),
        "format": value,
    }


def _simulator_has_it(config: pb.Config) -> bool:
    """Whether the simulator itself replays or writes the data set, so that no store runs beside it."""
    replays = config.general.mode == pb.MODE_SIMULATION and config.simulation.mode == simulation_pb2.PASSIVE
    return replays or makes_episodes(config)


def makes_episodes(config: pb.Config) -> bool:
    """Whether the simulator writes the data set."""
    return config.general.mode == pb.MODE_SIMULATION and config.simulation.HasField("generate")


def _folder(path: str, findings: Findings, source: str) -> str:
    """Folder of the file that holds a block or field."""
    position = findings.positions.value(path)
    named_in = position.file if position is not None and Path(position.file).is_file() else source
    return str(Path(named_in).absolute().parent)


def physics_of(services: list[ResolvedService]) -> dict[str, Any]:
    """What simulated devices must know of the simulation that they are part of; empty where there is none."""
    for resolved in services:
        if resolved.service.kind is SimulatorSpec and resolved.settings is not None:
            return {"simulation": resolved.settings.model_dump(mode="json")}
    return {}


def service_spec(resolved: ResolvedService, registry: Registry) -> NodeSpec:
    """Makes the node spec of a service."""
    from google.protobuf import json_format

    from joshua.plan import NodeKind, NodeSpec

    service, spec, settings = resolved.service, resolved.spec, resolved.settings
    values = json_format.MessageToDict(service.block, preserving_proto_field_name=True)
    return NodeSpec(
        name=service.name,
        kind=NodeKind.SERVICE,
        role=service.enum_value,
        block=service.name,
        plugin=registry.owner(spec).distribution,
        behaviour=spec.implementation,
        implementation=spec.implementation,
        settings_type=spec.settings,
        settings=values if settings is None else settings.model_dump(mode="json"),
        context=resolved.context,
        process_group=PHYSICS_GROUP if service.kind is SimulatorSpec else "",
        # a physics that starts anew is another one: whatever was done in it is gone
        restart="stop-run" if service.kind is SimulatorSpec else "on-failure",
    )


def _present(config: pb.Config, share: ModeShare) -> list[Service]:
    ai = config.ai
    services = []
    if "data_store" in share.services and ai.HasField("data_store") and not _simulator_has_it(config):
        value = _name(pb.DataFormat, ai.data_store.format)
        services.append(Service("ai.data_store", StoreSpec, ai.data_store, value))
    if "training" in share.services and ai.HasField("training"):
        value = _trainer_value(ai.training)
        services.append(Service("ai.training", TrainerSpec, ai.training, value))
    if "simulation" in share.services and config.HasField("simulation"):
        value = _name(simulation_pb2.SimulationMode, config.simulation.mode)
        services.append(Service("simulation", SimulatorSpec, _simulation(config), value))
    return services


def _simulation(config: pb.Config) -> Any:
    """The simulation block as far as the mode uses it: only MODE_SIMULATION makes episodes by itself."""
    block = config.simulation
    if config.general.mode != pb.MODE_SIMULATION and block.HasField("generate"):
        block = type(block)()
        block.CopyFrom(config.simulation)
        block.ClearField("generate")
        block.ClearField("trajectory_path")  # which drives the episodes
    return block


def _trainer_value(training: pb.Training) -> str:
    """A reinforcement learner is chosen by its simulator, every other trainer by its method."""
    if training.method == pb.METHOD_RL and training.simulator_backend:
        return _name(pb.SimulatorBackend, training.simulator_backend)
    return _name(pb.TrainingMethod, training.method)


def _name(enum: Any, number: int) -> str:
    return str(enum.Name(number)) if number in enum.values() else str(number)

"""Service nodes: the data store, the trainer and the simulator that a mode runs beside the devices."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from joshua.generator.findings import Findings
from joshua.modes.share import ModeShare, Need
from joshua.plugins import Provision, ProvisionKind, Registry
from joshua.schema import config_pb2 as pb
from joshua.schema import simulation_pb2

if TYPE_CHECKING:
    from joshua.plan import NodeSpec


@dataclass(frozen=True)
class Service:
    """A service block that stands in the file, and what its plugin is asked by."""

    path: str
    kind: ProvisionKind
    block: Any
    enum_value: str

    @property
    def name(self) -> str:
        """Name of the block, which becomes the node's name."""
        return self.path.rpartition(".")[2]


@dataclass(frozen=True)
class ResolvedService:
    """A service block with the provision that runs it."""

    service: Service
    provision: Provision


def resolve_services(
    config: pb.Config, registry: Registry, share: ModeShare, findings: Findings
) -> list[ResolvedService]:
    """Finds what runs the service blocks of a mode; a missing plugin becomes a finding."""
    resolved = []
    for service in _present(config, share):
        provision = registry.find(service.kind, service.name, service.enum_value)
        if provision is None:
            required = share.services[service.name] is Need.REQUIRED
            findings.service_missing(
                service.path, service.kind, service.enum_value, registry, required=required
            )
        else:
            resolved.append(ResolvedService(service, provision))
    return resolved


def service_spec(resolved: ResolvedService, registry: Registry) -> NodeSpec:
    """Makes the node spec of a service."""
    from google.protobuf import json_format

    from joshua.plan import NodeKind, NodeSpec

    service, provision = resolved.service, resolved.provision
    return NodeSpec(
        name=service.name,
        kind=NodeKind.SERVICE,
        role=service.enum_value,
        block=service.name,
        plugin=registry.owner(provision).distribution,
        behaviour=provision.behaviour or provision.implementation,
        implementation=provision.implementation,
        settings_type=provision.settings,
        settings=json_format.MessageToDict(service.block, preserving_proto_field_name=True),
    )


def _present(config: pb.Config, share: ModeShare) -> list[Service]:
    ai = config.ai
    services = []
    if "data_store" in share.services and ai.HasField("data_store"):
        value = _name(pb.DataFormat, ai.data_store.format)
        services.append(Service("ai.data_store", ProvisionKind.STORE, ai.data_store, value))
    if "training" in share.services and ai.HasField("training"):
        value = _trainer_value(ai.training)
        services.append(Service("ai.training", ProvisionKind.TRAINER, ai.training, value))
    if "simulation" in share.services and config.HasField("simulation"):
        value = _name(simulation_pb2.SimulationMode, config.simulation.mode)
        services.append(Service("simulation", ProvisionKind.SIMULATOR, config.simulation, value))
    return services


def _trainer_value(training: pb.Training) -> str:
    """A reinforcement learner is chosen by its simulator, every other trainer by its method."""
    if training.method == pb.METHOD_RL and training.simulator_backend:
        return _name(pb.SimulatorBackend, training.simulator_backend)
    return _name(pb.TrainingMethod, training.method)


def _name(enum: Any, number: int) -> str:
    return str(enum.Name(number)) if number in enum.values() else str(number)

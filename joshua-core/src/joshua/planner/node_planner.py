"""The node specs of devices and models, with what each must know of the others."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from joshua.features.derive import features_of
from joshua.modes import ModeSpec
from joshua.modes.services import PHYSICS_GROUP
from joshua.plan import (
    ActuatorFacts,
    Commander,
    JointRange,
    ModelFacts,
    NodeKind,
    NodeSpec,
    SensorFacts,
    TopicSpec,
)
from joshua.plan.facts import Facts
from joshua.plan.graph import Endpoint, NodeEntry, RobotGraph
from joshua.planner.devices import Wanted
from joshua.planner.diagnostics import Diagnostics
from joshua.planner.request import Request
from joshua.planner.resolution import Resolved
from joshua.planner.safety import safety_facts
from joshua.plugins import ActuatorSpec, ModelSpec, Registry, SensorSpec
from joshua.schema import config_pb2 as pb
from joshua.schema import data_type_pb2, data_types

RESTART = {
    pb.RESTART_DEFAULT: "on-failure",
    pb.RESTART_ON_FAILURE: "on-failure",
    pb.RESTART_NEVER: "never",
    pb.RESTART_STOP_RUN: "stop-run",
}


class NodePlanner:
    """Makes the node specs of one configuration.

    Args:
        joints: joints of each actuator by field path of its node block.
        request: names the configuration file, at whose folder relative paths start.
        physics: settings of the simulation; None where there is none.
        allow_uncalibrated: joints without calibration may be energised.
    """

    def __init__(
        self,
        mode: ModeSpec,
        graph: RobotGraph,
        registry: Registry,
        joints: Mapping[str, Sequence[JointRange]],
        findings: Diagnostics,
        request: Request,
        physics: dict[str, Any] | None,
        *,
        allow_uncalibrated: bool,
    ) -> None:
        self._request = request
        self._allow_uncalibrated = allow_uncalibrated
        self._registry = registry
        self._joints = joints
        self._findings = findings
        self._without_native: dict[str, list[Wanted]] = {}
        self._settings: dict[str, Any] = {}
        self._graph = graph
        self._physics = physics
        self._testing = mode.verdict
        self._runs_models = mode.models

    def specs(self, nodes: list[Resolved]) -> list[NodeSpec]:
        """Makes the specs of all resolved nodes."""
        self._settings = {resolved.want.entry.path: resolved.settings for resolved in nodes}
        specs = [self._spec(resolved) for resolved in nodes]
        for plugin, wants in self._without_native.items():
            self._findings.native_missing(wants, plugin)
        return specs

    def _spec(self, resolved: Resolved) -> NodeSpec:
        want, spec = resolved.want, resolved.spec
        node = want.entry.node
        plugin = self._registry.owner(spec).distribution
        native = node.node_type == pb.CPP and bool(spec.native)
        if node.node_type == pb.CPP and not native:
            self._without_native.setdefault(plugin, []).append(want)
        settings = resolved.settings
        return NodeSpec(
            name=node.node_name,
            namespace=want.entry.namespace,
            frame_id=node.frame_id or node.node_name,
            node_id=node.node_id,
            kind=NodeKind(want.kind.kind),
            role=want.enum_value,
            block=want.block_name,
            plugin=plugin,
            behaviour=spec.behaviour or spec.standard_behaviour,
            implementation=spec.native if native else spec.implementation,
            settings_type=spec.settings,
            settings=settings.model_dump(mode="json") if settings is not None else {},
            facts=self._facts(resolved),
            backend="native" if native else "python",
            publishers=tuple(self._topics(want, publishers=True)),
            subscriptions=tuple(self._topics(want, publishers=False)),
            process_group=node.process_group or (PHYSICS_GROUP if want.is_simulated else ""),
            interpreter=self._interpreter(want),
            host=node.host,
            restart=RESTART.get(node.restart, "on-failure"),
        )

    def _interpreter(self, want: Wanted) -> str:
        """The interpreter of a node; a relative path starts at the file that names it, as in the checks."""
        if not want.entry.node.python:
            return ""
        from joshua.config.input_paths import with_absolute_paths

        positions = self._findings.positions
        return with_absolute_paths(want.entry.node, want.entry.path, positions, self._request.path).python

    def _own(self, want: Wanted, *, publishers: bool) -> list[Endpoint]:
        return [
            endpoint
            for endpoint in self._graph.endpoints
            if endpoint.entry.path == want.entry.path and endpoint.is_publisher is publishers
        ]

    def _topics(self, want: Wanted, *, publishers: bool) -> Iterable[TopicSpec]:
        for endpoint in self._own(want, publishers=publishers):
            yield TopicSpec(
                name=endpoint.topic,
                type_name=data_types.type_name(endpoint.block.data_type),
                qos=endpoint.qos,
                rate_hz=endpoint.block.publish_rate_hz if publishers else 0.0,
            )

    def _facts(self, resolved: Resolved) -> Facts:
        """What a node must know of itself and others, such as its leader, or the joints that it commands."""
        want, spec = resolved.want, resolved.spec
        common: dict[str, Any] = {
            "testing": self._testing,
            "hang_after_s": spec.hang_after_s,
            "ready_timeout_s": spec.ready_timeout_s,
        }
        if isinstance(spec, ModelSpec):
            driven = self._graph.driven_by(want.entry)
            commanded = (joint for entry in driven for joint in self._joints.get(entry.path, ()))
            names = {path: [joint.name for joint in joints] for path, joints in self._joints.items()}
            features = features_of(self._graph, names, self._settings, reader=want.entry)
            return ModelFacts(joints=tuple(commanded), features=tuple(features.values()), **common)
        common["simulation"] = self._physics if want.is_simulated else None
        if isinstance(spec, SensorSpec):
            return SensorFacts(joints=resolved.joints, terminal=spec.terminal, **common)
        assert isinstance(spec, ActuatorSpec)
        return ActuatorFacts(
            joints=tuple(self._joints[want.entry.path]),
            commanders=tuple(commanders(self._graph, want.entry, self._joints, models=self._runs_models)),
            external=tuple(item.topic for item in self._graph.commands(want.entry) if item.block.external),
            allow_uncalibrated=self._allow_uncalibrated,
            dry_run=self._request.dry_run,
            **common,
            **safety_facts(want.entry.owner, spec),
        )


def commanders(
    graph: RobotGraph, entry: NodeEntry, joints: Mapping[str, Sequence[JointRange]], *, models: bool
) -> Iterable[Commander]:
    """The nodes and services of a run whose commands an actuator accepts.

    Args:
        joints: of each actuator, by the field path of its node block; models: the run starts the models.
    """
    topics = {item.topic for item in graph.commands(entry)}
    for source in graph.commanders(entry):
        if source.topic in topics and (models or not source.entry.is_model):
            maps = source.entry.leads and source.block.data_type == data_type_pb2.JOINT_STATE
            ranges = tuple(joints.get(source.entry.path, ())) if maps else None
            yield Commander(source.entry.full_name, source.topic, ranges, source.block.override)
    for service in graph.services:
        for topic in service.topics:
            if topic.is_publisher and topic.name in topics:
                yield Commander(f"/{service.name}", topic.name)

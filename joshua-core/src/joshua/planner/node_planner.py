"""The node specs of devices and models, with the facts that they need about each other."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from joshua.features.derive import features_of
from joshua.modes.services import PHYSICS_GROUP
from joshua.plan import (
    ActuatorFacts,
    Commander,
    JointRange,
    NodeKind,
    NodeSpec,
    SensorFacts,
    TopicSpec,
)
from joshua.plan.facts import Facts
from joshua.plan.graph import NodeEntry, RobotGraph
from joshua.planner.draft import Draft
from joshua.planner.model_planner import model_facts, needs_of, state_topics
from joshua.planner.resolution import Resolved, safety_facts
from joshua.plugins import ActuatorSpec, ModelSpec, SensorSpec
from joshua.schema import config_pb2 as pb
from joshua.schema import data_type_pb2, data_types

#: Motion of a leader arm after which it overrides: well above noise and a knock at the desk, 6 degrees.
OVERRIDE_MOTION_RAD = 0.1

RESTART = {
    pb.RESTART_DEFAULT: "on-failure",
    pb.RESTART_ON_FAILURE: "on-failure",
    pb.RESTART_NEVER: "never",
    pb.RESTART_STOP_RUN: "stop-run",
}


def node_specs(draft: Draft, nodes: list[Resolved], physics: dict[str, Any] | None) -> list[NodeSpec]:
    """Make the node specs of a configuration.

    Args:
        physics: settings of the simulation; None if there is none.
    """
    settings = {item.want.entry.path: item.settings for item in nodes}
    without_native: dict[str, list[NodeEntry]] = {}
    for item in nodes:
        if item.want.entry.node.node_type == pb.CPP and not item.spec.native:
            plugin = draft.registry.owner(item.spec).distribution
            without_native.setdefault(plugin, []).append(item.want.entry)
    for plugin, entries in without_native.items() if draft.launch else ():
        names = ", ".join(entry.node.node_name for entry in entries)
        message = f"{plugin} has no native implementation of {names}: the Python implementation runs"
        draft.findings.append(draft.note("native-missing", message, f"{entries[0].path}.node_type"))
    return [_spec(draft, item, _facts(draft, item, settings, physics)) for item in nodes]


def _spec(draft: Draft, item: Resolved, facts: Facts) -> NodeSpec:
    want, spec, settings = item.want, item.spec, item.settings
    node = want.entry.node
    native = node.node_type == pb.CPP and bool(spec.native)
    return NodeSpec(
        name=node.node_name,
        namespace=want.entry.namespace,
        frame_id=node.frame_id or node.node_name,
        node_id=node.node_id,
        kind=NodeKind(want.kind.kind),
        role=want.enum_value,
        block=want.block_name,
        plugin=draft.registry.owner(spec).distribution,
        behaviour=spec.behaviour or spec.standard_behaviour,
        implementation=spec.native if native else spec.implementation,
        settings_type=spec.settings,
        settings=settings.model_dump(mode="json") if settings is not None else {},
        facts=facts,
        backend="native" if native else "python",
        publishers=tuple(_topics(draft.graph, want.entry, publishers=True)),
        subscriptions=(*_topics(draft.graph, want.entry, publishers=False), *_states(draft, item)),
        process_group=node.process_group or (PHYSICS_GROUP if want.is_simulated else ""),
        interpreter=_interpreter(draft, want.entry),
        host=node.host,
        restart=RESTART.get(node.restart, "on-failure"),
    )


def store_facts(draft: Draft, nodes: list[Resolved]) -> dict[str, Any]:
    """Facts of a data store about the robot: features, arms, and commanders."""
    graph, joints = draft.graph, draft.joints
    settings = {item.want.entry.path: item.settings for item in nodes}
    features = features_of(graph, _names(draft), settings).values()
    owners = {entry.applied_command_topic: entry.path for entry in graph.actuators}
    owners |= {item.topic: item.entry.path for item in graph.usable if item.is_publisher}
    driven = {entry.applied_command_topic: entry for entry in graph.actuators}
    return {
        "features": tuple(features),
        "arms": {
            feature.key: tuple(joints[owners[feature.topic]])
            for feature in features
            if feature.unit and owners.get(feature.topic) in joints
        },
        "commands": {
            feature.key: next(item.topic for item in graph.commands(driven[feature.topic]))
            for feature in features
            if feature.topic in driven
        },
        "robot_type": draft.config.general.robot_type,
    }


def _names(draft: Draft) -> dict[str, list[str]]:
    return {path: [joint.name for joint in joints] for path, joints in draft.joints.items()}


def _interpreter(draft: Draft, entry: NodeEntry) -> str:
    """The interpreter of a node. A relative path starts at the file that contains it, as in the checks."""
    if not entry.node.python:
        return ""
    from joshua.config.input_paths import with_absolute_paths

    return with_absolute_paths(entry.node, entry.path, draft.loaded.positions, draft.request.path).python


def _topics(graph: RobotGraph, entry: NodeEntry, *, publishers: bool) -> Iterable[TopicSpec]:
    for endpoint in graph.all_of_entry(entry):
        if endpoint.is_publisher is publishers:
            yield TopicSpec(
                name=endpoint.topic,
                type_name=data_types.type_name(endpoint.block.data_type),
                qos=endpoint.qos,
                rate_hz=endpoint.block.publish_rate_hz if publishers else 0.0,
            )


def _states(draft: Draft, item: Resolved) -> Iterable[TopicSpec]:
    """The states that a model receives without a subscription in the file."""
    for own in state_topics(draft, item, needs_of(item)) if item.want.entry.is_model else ():
        yield TopicSpec(name=own.topic, type_name=data_types.type_name(own.block.data_type), qos=own.qos)


def _facts(
    draft: Draft, item: Resolved, settings: Mapping[str, Any], physics: dict[str, Any] | None
) -> Facts:
    """Facts of a node, such as its leader, or the joints that it commands."""
    entry, spec, graph = item.want.entry, item.spec, draft.graph
    common: dict[str, Any] = {
        "testing": draft.mode.verdict,
        "hang_after_s": getattr(entry.owner, "hang_after_s", 0.0) or spec.hang_after_s,
        "ready_timeout_s": spec.ready_timeout_s,
    }
    if isinstance(spec, ModelSpec):
        return model_facts(draft, item, settings, common)
    common["simulation"] = physics if item.want.is_simulated else None
    if isinstance(spec, SensorSpec):
        return SensorFacts(joints=item.joints, terminal=spec.terminal, **common)
    assert isinstance(spec, ActuatorSpec)
    return ActuatorFacts(
        joints=tuple(draft.joints[entry.path]),
        commanders=tuple(commanders(graph, entry, draft.joints, models=draft.mode.models)),
        intervention=bool(graph.intervention_topic(entry)),
        external=tuple(endpoint.topic for endpoint in graph.commands(entry) if endpoint.block.external),
        allow_uncalibrated=draft.allows_uncalibrated,
        dry_run=draft.request.dry_run,
        source=draft.request.path,
        overrides=tuple(draft.request.overrides),
        node_name=entry.node.node_name,
        **common,
        **safety_facts(entry.owner, spec),
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
        starts = (models or not source.entry.is_model) and not (graph.replays and source.entry.leads)
        if source.topic in topics and starts:
            maps = source.entry.leads and source.block.data_type == data_type_pb2.JOINT_STATE
            ranges = tuple(joints.get(source.entry.path, ())) if maps else None
            motion_rad = motion_rad_of(source.block) if maps and source.block.override else 0.0
            yield Commander(source.entry.full_name, source.topic, ranges, source.block.override, motion_rad)
    for service in graph.services:
        for topic in service.topics:
            if topic.is_publisher and topic.name in topics:
                yield Commander(f"/{service.name}", topic.name)


def motion_rad_of(publisher: pb.Publisher) -> float:
    """How far a leader moves until it overrides."""
    is_set = publisher.HasField("override_motion_rad")
    return float(publisher.override_motion_rad) if is_set else OVERRIDE_MOTION_RAD

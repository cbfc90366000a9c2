"""Plans models: their facts from the entry, and whether the robot meets their needs."""

from __future__ import annotations

import importlib.util
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from joshua.config.checks.device_table import messages_of
from joshua.config.input_paths import folder_of
from joshua.features.derive import features_of, own_names
from joshua.features.feature_set import FeatureSet
from joshua.features.needs import as_trained, joined, unmet
from joshua.modes.services import awaits_weights, judges_robot
from joshua.plan import (
    Compute,
    Diagnostic,
    Execution,
    JointRange,
    ModelArm,
    ModelFacts,
    ModelNeeds,
    NodeSpec,
    TopicSpec,
)
from joshua.plan.feature import IMAGES, Feature
from joshua.plan.graph import Endpoint, NodeEntry
from joshua.schema import data_type_pb2

_IMAGE, _COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"

if TYPE_CHECKING:
    from joshua.planner.draft import Draft
    from joshua.planner.resolution import Resolved
    from joshua.plugins.model_settings import ModelContext


def model_context(draft: Draft, entry: NodeEntry) -> ModelContext:
    """Input for the settings of a model beside its block."""
    from joshua.plugins.block_values import block_values
    from joshua.plugins.model_settings import ModelContext

    owner, path = entry.owner, f"{entry.owner_path}.pretrained_model_name_or_path"
    weights = owner.pretrained_model_name_or_path
    if weights:
        folder = folder_of(draft.loaded.positions, path, draft.request.path)
        place = Path(os.path.normpath(folder / os.path.expanduser(weights)))  # noqa: PTH111 (as the checks)
        if place.exists():
            weights = str(place)
        elif (shipped := draft.registry.packaged_weights(weights)) is not None:
            weights = str(shipped)
    elif awaits_weights(draft.config):
        weights = "weights of the training"  # neither a folder nor a name on the hub: its needs stay open
    return ModelContext(weights, owner.task, Compute(**block_values(owner.compute)), _rate(entry))


def needs_of(item: Resolved) -> ModelNeeds:
    """The needs of a model, from its settings. Raises FieldError."""
    from joshua.plugins.model_settings import ModelSettings  # requires pydantic, as the settings did

    return item.settings.needs() if isinstance(item.settings, ModelSettings) else ModelNeeds()


def state_topics(draft: Draft, item: Resolved, needs: ModelNeeds) -> list[Endpoint]:
    """The states of the actuators that a model commands, if it needs them and subscribes to none."""
    graph, entry = draft.graph, item.want.entry
    if not needs.reads_state:
        return []
    seen = {own.topic for own in graph.of_entry(entry) if not own.is_publisher}
    found = []
    for actuator in graph.driven_by(entry):
        states = [
            own
            for own in graph.of_entry(actuator)
            if own.is_publisher and own.block.data_type == data_type_pb2.JOINT_STATE
        ]
        found += states[:1] if not any(own.topic in seen for own in states) else []
    return found


def model_facts(
    draft: Draft, item: Resolved, settings: Mapping[str, Any], common: dict[str, Any]
) -> ModelFacts:
    """Facts of a model's node, with features by the model's keys."""
    from joshua.plugins.block_values import block_values

    owner, needs, graph = item.want.entry.owner, needs_of(item), draft.graph
    topics = (graph.intervention_topic(other) for other in graph.driven_by(item.want.entry))
    features, joints = _as_trained(draft, item, settings, needs)
    return ModelFacts(
        joints=joints,
        arms=_arms(draft, item),
        features=tuple(features.values()),
        task=getattr(item.settings, "task", "") or owner.task,
        execution=Execution(**block_values(owner.execution)),
        compute=Compute(**block_values(owner.compute)),
        reads_task=needs.reads_task,
        interventions=tuple(filter(None, topics)),
        is_judged=judges_robot(draft.config),
        awaits_weights=awaits_weights(draft.config),
        **common,
    )


def check_models(draft: Draft, nodes: Sequence[Resolved]) -> None:
    """Find needs of models that the robot does not meet."""
    settings = {item.want.entry.path: item.settings for item in nodes}
    for item in nodes:
        if item.want.entry.is_model and (item.settings is not None or not item.spec.settings):
            draft.findings += _findings(draft, item, settings)


def _findings(draft: Draft, item: Resolved, settings: Mapping[str, Any]) -> Iterator[Diagnostic]:
    from joshua.plugins.settings import FieldError

    entry, owner = item.want.entry, item.want.entry.owner
    path = entry.owner_path
    try:
        needs = needs_of(item)
    except FieldError as error:
        field = f"{item.want.block_path}.{error.field}" if error.field else path
        yield draft.error(
            "invalid-setting", str(error), field, allowed=error.allowed, remedy=error.remedy or None
        )
        return
    if entry.node.host == draft.request.host and not entry.node.python:
        yield from _libraries(draft, entry, needs)
    try:
        features, joints = _as_trained(draft, item, settings, needs)
    except ValueError as error:
        yield draft.error("rename-unfit", str(error), f"{path}.rename")
        return
    arms = _arms(draft, item)
    if arms and arms[0].prefix and len({arm.commands for arm in arms}) < len(arms):
        names = " and ".join(arm.prefix.removesuffix("_") for arm in arms)
        message = (
            f"{entry.node.node_name} commands {names} by one topic, and their joints have the same names"
        )
        remedy = "Give the model one publisher for each arm, and each arm the subscription to its own"
        yield draft.error("model-unfit", message, f"{path}.node.publishers", remedy=remedy)
    strategy = owner.DESCRIPTOR.fields_by_name["execution"].message_type.fields_by_name["strategy"]
    chosen = strategy.enum_type.values_by_number.get(owner.execution.strategy)
    for lack in unmet(needs, features, joints, _rate(entry), chosen.name if chosen else "") if joints else ():
        place = f"{path}.{lack.field}" if lack.field else path
        yield draft.error("model-unfit", lack.message, place, allowed=lack.allowed, remedy=lack.remedy)
    if needs.reads_task and not (getattr(item.settings, "task", "") or owner.task):
        name = entry.node.node_name
        message = f"{name} has no task; the arm holds until it gets one"
        remedy = 'Run `joshua task "…"` during the run, or add task: "…" to the model'
        yield draft.note("task-missing", message, path, remedy=remedy)


def _libraries(draft: Draft, entry: NodeEntry, needs: ModelNeeds) -> Iterator[Diagnostic]:
    """What a model imports and this interpreter does not have; another one is asked at its start only."""
    missing = [name for name in needs.libraries if importlib.util.find_spec(name) is None]
    if missing:
        names = ", ".join(missing)
        message = f"{entry.node.node_name} requires {names}, which {sys.executable} does not have"
        yield draft.missing("extra-missing", message, entry.owner_path, found="", remedy=needs.install)


def _as_trained(
    draft: Draft, item: Resolved, settings: Mapping[str, Any], needs: ModelNeeds
) -> tuple[FeatureSet, tuple[JointRange, ...]]:
    """Features and joints of a model by its own keys and in its own order. Raises ValueError."""
    features = joined(needs, _renamed(draft, item, settings, needs), _arms(draft, item))
    return as_trained(needs, features, tuple(_joints(draft, item)))


def _renamed(draft: Draft, item: Resolved, settings: Mapping[str, Any], needs: ModelNeeds) -> FeatureSet:
    """The features of a model's subscriptions, by the model's keys. Raises ValueError."""
    names = {path: [joint.name for joint in joints] for path, joints in draft.joints.items()}
    entry = item.want.entry
    features = features_of(
        draft.graph, names, settings, reader=entry, beside=state_topics(draft, item, needs)
    )
    found: dict[str, Feature] = dict(features)
    for row in entry.owner.rename:
        key = next((key for key in features if row.robot in (key, key.removeprefix(IMAGES))), None)
        if key is None:
            raise ValueError(
                f"{row.robot} is none of what the model gets: {', '.join(features) or 'nothing'}"
            )
        picture = features[key].is_picture and "." not in row.model
        found[key] = replace(features[key], key=f"{IMAGES}{row.model}" if picture else row.model)
    return FeatureSet(found.values())


def with_compressed_pictures(draft: Draft, specs: Sequence[NodeSpec]) -> list[NodeSpec]:
    """Send pictures to a model on another machine as JPEG, if the camera supports it.

    The camera gets an additional topic, to which the model subscribes instead of the raw one.
    """
    entries = {entry.full_name: entry for entry in draft.graph.entries}
    hosts = {topic.name: spec for spec in specs for topic in spec.publishers if topic.type_name == _IMAGE}
    changed = {spec.full_name: spec for spec in specs}
    for model in specs:
        facts = model.facts
        for topic in model.subscriptions if isinstance(facts, ModelFacts) else ():
            camera = hosts.get(topic.name)
            if topic.type_name != _IMAGE or camera is None or camera.host == model.host:
                continue
            offered = messages_of(entries[camera.full_name].owner).publishes or ()
            if data_type_pb2.COMPRESSED_IMAGE not in offered:
                continue
            raw = next(item for item in camera.publishers if item.name == topic.name)
            small = raw.model_copy(update={"name": f"{topic.name}/compressed", "type_name": _COMPRESSED})
            changed[camera.full_name] = _with_topic(changed[camera.full_name], small)
            changed[model.full_name] = _instead(changed[model.full_name], topic.name, small)
            message = f"{model.name} runs on another machine than {camera.name}: pictures travel as JPEG"
            draft.findings.append(draft.note("pictures-compressed", message, found=topic.name))
    return list(changed.values())


def _with_topic(camera: NodeSpec, topic: TopicSpec) -> NodeSpec:
    known = any(item.name == topic.name for item in camera.publishers)
    return camera if known else camera.model_copy(update={"publishers": (*camera.publishers, topic)})


def _instead(model: NodeSpec, name: str, topic: TopicSpec) -> NodeSpec:
    """The node of a model with one subscription replaced."""
    facts = model.facts_as(ModelFacts)
    features = tuple(replace(f, topic=topic.name) if f.topic == name else f for f in facts.features)
    own = topic.model_copy(update={"rate_hz": 0.0})
    topics = tuple(own if item.name == name else item for item in model.subscriptions)
    return model.model_copy(update={"subscriptions": topics, "facts": replace(facts, features=features)})


def _joints(draft: Draft, item: Resolved) -> Iterator[JointRange]:
    """The joints that a model commands, by its names of them."""
    driven = {other.path: other for other in draft.graph.driven_by(item.want.entry)}
    prefixes = [arm.prefix for arm in _arms(draft, item)] or [""]
    for path, prefix in zip(driven, prefixes, strict=True) if driven else ():
        for joint in draft.joints.get(path, ()):
            yield replace(joint, name=prefix + joint.name)


def _arms(draft: Draft, item: Resolved) -> tuple[ModelArm, ...]:
    """The arms of a model that commands several; joints of one name get the part of its node's name."""
    graph, entry = draft.graph, item.want.entry
    driven = list({other.path: other for other in graph.driven_by(entry)}.values())
    if len(driven) < 2:
        return ()
    published = {own.topic for own in graph.of_entry(entry) if own.is_publisher}
    own = own_names(other.full_name for other in driven)
    joints = [tuple(joint.name for joint in draft.joints.get(other.path, ())) for other in driven]
    clash = len({name for names in joints for name in names}) < sum(map(len, joints))
    found = []
    for other, names, prefix in zip(driven, joints, own, strict=True):
        ends = graph.of_entry(other)
        commands = next((end.topic for end in ends if end.topic in published), "")
        states = (end for end in ends if end.block.data_type == data_type_pb2.JOINT_STATE)
        state = next((end.topic for end in states if end.is_publisher), "")
        found.append(ModelArm(commands, state, names, f"{prefix}_" if clash else ""))
    return tuple(found)


def _rate(entry: NodeEntry) -> float:
    return max((item.publish_rate_hz for item in entry.node.publishers), default=0.0)

"""Features from the graph of a robot: what its nodes publish, and what its actuators are told."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from joshua.features.feature_set import FeatureSet
from joshua.plan.feature import ACTION, IMAGES, INTERVENTION, STATE, Feature
from joshua.plan.graph import Endpoint, NodeEntry, RobotGraph
from joshua.schema import data_type_pb2 as types
from joshua.schema import data_types

_PICTURES = (types.IMAGE, types.COMPRESSED_IMAGE)

#: What describes other topics, and shows nothing by itself.
_DESCRIPTIONS = (types.CAMERA_INFO,)

#: Last parts of topics that say nothing about what is shown.
_TOPIC_ENDS = ("image_raw", "image", "compressed", "joint_states")


def features_of(
    graph: RobotGraph,
    joints: Mapping[str, Sequence[str]],
    settings: Mapping[str, Any],
    *,
    reader: NodeEntry | None = None,
    beside: Iterable[Endpoint] = (),
) -> FeatureSet:
    """Derives the features of a robot, or of what one of its nodes subscribes to.

    The joints of the arm are ``observation.state`` and ``action``; with several arms the name of the node
    follows, as in ``observation.state.left_arm``. Pictures are ``observation.images.`` and the name of the
    camera without «camera»; what else is published is ``observation.`` and the name of its node or topic. A
    topic that commands an actuator is no observation. ``action`` is what the actuator says that it wrote,
    after ramp and limits. Where a person can take over from a model, ``intervention`` says when one has.

    Args:
        graph: of the nodes.
        joints: names of each actuator's joints; settings: of each sensor. By field path of the node block.
        reader: a node, such as a model, of whose subscriptions the features are: observations only, and
            topics that no node publishes count too, and a key that comes again gets a number; None for
            everything that the robot shows, and its actions.
        beside: publishers whose topics the reader gets without a subscription in the file.

    Raises:
        ValueError: two nodes would have one key; the message names it.
    """
    robot = _Robot(graph, joints, settings)
    if reader is None:
        return FeatureSet(robot.everything())
    seen: dict[str, Feature] = {}
    for item in (*(own for own in graph.of_entry(reader) if not own.is_publisher), *beside):
        feature = robot.observed(item)
        key, number = feature.key, 2
        while feature.key in seen:
            feature, number = replace(feature, key=f"{key}_{number}"), number + 1
        seen[feature.key] = feature
    return FeatureSet(seen.values())


def camera_key(name: str) -> str:
    """Key of a camera's pictures: ``camera_top`` and ``/camera/top`` give ``observation.images.top``."""
    parts = [part for part in _plain(name).split("_") if part not in ("", "camera")]
    return IMAGES + ("_".join(parts) or "camera")


class _Robot:
    """The nodes of a robot, by what they are to others."""

    def __init__(
        self, graph: RobotGraph, joints: Mapping[str, Sequence[str]], settings: Mapping[str, Any]
    ) -> None:
        self._graph, self._joints, self._settings = graph, joints, settings
        self._commands = {item.topic for entry in graph.actuators for item in graph.commands(entry)}
        self._publishers: dict[str, Endpoint] = {}
        for item in graph.usable:
            if item.is_publisher:
                self._publishers.setdefault(item.topic, item)
        self._arms = [
            entry
            for entry in graph.actuators
            if not entry.leads and any(self._is_state(item) for item in graph.of_entry(entry))
        ]
        self._arm_paths = {entry.path for entry in self._arms}

    def everything(self) -> Iterable[Feature]:
        found: dict[str, Feature] = {}
        for entry in self._graph.entries:
            if entry.is_sensor or entry.path in self._arm_paths:
                own: dict[str, Feature] = {}
                for item in self._graph.of_entry(entry):
                    if item.is_publisher and self._is_observation(item):
                        feature = self.observed(item)
                        own.setdefault(feature.key, feature)  # a camera's raw and compressed pictures are one
                both = own.keys() & found.keys()
                if both:
                    raise ValueError(f"two nodes show {min(both)}: rename {entry.full_name} or the other one")
                found |= own
        yield from found.values()
        for arm in self._arms:
            if self._graph.commands(arm):
                key = self._of_arm(ACTION, arm)
                yield Feature.joints(key, self._names(arm), topic=arm.applied_command_topic)
            if topic := self._graph.intervention_topic(arm):
                yield Feature(self._of_arm(INTERVENTION, arm), "bool", (1,), topic=topic)

    def observed(self, item: Endpoint) -> Feature:
        """The feature of a topic, as the node that publishes it describes it."""
        topic, data_type = item.topic, item.block.data_type
        source = self._publishers.get(topic)
        entry = source.entry if source is not None else None
        if data_type in _PICTURES:
            settings = self._settings.get(entry.path) if entry is not None else None
            height, width = (int(getattr(settings, side, 0)) for side in ("height", "width"))
            key = camera_key(entry.full_name if entry is not None else _shown_by(topic))
            return Feature.picture(key, height, width, topic=topic)
        if data_type == types.JOINT_STATE:
            names = self._names(entry) if entry is not None else ()
            key = f"observation.{_plain(entry.full_name) if entry is not None else _shown_by(topic)}"
            if entry is not None and entry.path in self._arm_paths and topic not in self._commands:
                key = self._of_arm(STATE, entry)
            return Feature.joints(key, names, topic=topic)
        dtype, shape = _numbers(data_types.type_name(data_type))
        return Feature(f"observation.{_shown_by(topic)}", dtype, shape, topic=topic)

    def _is_observation(self, item: Endpoint) -> bool:
        return item.topic not in self._commands and item.block.data_type not in _DESCRIPTIONS

    def _is_state(self, item: Endpoint) -> bool:
        return item.is_publisher and item.block.data_type == types.JOINT_STATE and self._is_observation(item)

    def _names(self, entry: NodeEntry) -> tuple[str, ...]:
        known = self._joints.get(entry.path) or getattr(self._settings.get(entry.path), "joint_names", ())
        return tuple(known or ())

    def _of_arm(self, key: str, arm: NodeEntry) -> str:
        return key if len(self._arms) == 1 else f"{key}.{_plain(arm.full_name)}"


def _plain(name: str) -> str:
    return name.strip("/").replace("/", "_")


def _shown_by(topic: str) -> str:
    """What a topic shows, by its name: ``top`` of ``/top/image_raw``."""
    parts = topic.strip("/").split("/")
    while len(parts) > 1 and parts[-1] in _TOPIC_ENDS:
        parts.pop()
    return "_".join(parts)


def _numbers(type_name: str) -> tuple[str, tuple[int, ...]]:
    """Type and shape of the numbers of a message that is neither picture nor joints."""
    package, _, name = type_name.partition("/msg/")
    if package != "std_msgs" or name.endswith("MultiArray"):
        return "float32", (0,)
    if name == "Bool":
        return "bool", (1,)
    return ("int64" if name.startswith(("Int", "UInt", "Byte", "Char")) else "float32"), (1,)

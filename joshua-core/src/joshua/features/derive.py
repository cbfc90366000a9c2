"""Derives features from the graph of a robot: what its nodes publish, and the commands of its actuators."""

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

#: Types that describe other topics and are no observation themselves.
_DESCRIPTIONS = (types.CAMERA_INFO,)

#: Last parts of topic names that do not describe the content.
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
    camera without "camera". Other topics are ``observation.`` and the name of their node or topic. A topic
    that commands an actuator is no observation. ``action`` is the command that the actuator reports as
    written, after ramp and limits. If a person can take over from a model, ``intervention`` marks when that
    happens.

    Args:
        graph: of the nodes.
        joints: names of each actuator's joints; settings: of each sensor. By field path of the node block.
        reader: a node, such as a model, whose subscriptions become the features: observations only. Topics
            without a publisher are included, and repeated keys are numbered. None for all observations of the
            robot and its actions.
        beside: publishers whose topics the reader receives without a subscription in the file.

    Raises:
        ValueError: two nodes would have the same key. The message names it.
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


def own_names(names: Iterable[str]) -> list[str]:
    """What tells nodes apart: ``left`` and ``right`` for ``left_arm`` and ``right_arm``."""
    plain = [_plain(name) for name in names]
    shared = set(plain[0].split("_")).intersection(*(name.split("_") for name in plain))
    own = ["_".join(word for word in name.split("_") if word not in shared) or name for name in plain]
    return own if len(set(own)) == len(own) else plain


class _Robot:
    """The nodes of a robot, by their role."""

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
                        own.setdefault(feature.key, feature)
                both = own.keys() & found.keys()
                if both:
                    raise ValueError(
                        f"two nodes provide {min(both)}: rename {entry.full_name} or the other one"
                    )
                found |= own
        yield from found.values()
        for arm in self._arms:
            if self._graph.commands(arm):
                key = self._of_arm(ACTION, arm)
                yield Feature.joints(key, self._names(arm), topic=arm.applied_command_topic)
            if topic := self._graph.intervention_topic(arm):
                yield Feature(self._of_arm(INTERVENTION, arm), "bool", (1,), topic=topic)

    def observed(self, item: Endpoint) -> Feature:
        """Return the feature of a topic, as described by the node that publishes it."""
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
    """The content of a topic, by its name: ``top`` of ``/top/image_raw``."""
    parts = topic.strip("/").split("/")
    while len(parts) > 1 and parts[-1] in _TOPIC_ENDS:
        parts.pop()
    return "_".join(parts)


def _numbers(type_name: str) -> tuple[str, tuple[int, ...]]:
    """Type and shape of the numbers in a message that is neither a picture nor a joint state."""
    package, _, name = type_name.partition("/msg/")
    if package != "std_msgs" or name.endswith("MultiArray"):
        return "float32", (0,)
    if name == "Bool":
        return "bool", (1,)
    return ("int64" if name.startswith(("Int", "UInt", "Byte", "Char")) else "float32"), (1,)

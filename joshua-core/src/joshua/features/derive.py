"""Features from the description of a robot: what its nodes publish, and what its actuators are told."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from joshua.features.feature_set import FeatureSet
from joshua.plan.feature import ACTION, IMAGES, STATE, Feature
from joshua.plan.node_spec import NodeKind, NodeSpec, TopicSpec

JOINT_STATE = "sensor_msgs/msg/JointState"
PICTURES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
LEADER = "ACTION_LEADER"

#: What describes other topics, and shows nothing by itself.
_DESCRIPTIONS = ("sensor_msgs/msg/CameraInfo",)

#: Last parts of topics that say nothing about what is shown.
_TOPIC_ENDS = ("image_raw", "image", "compressed", "joint_states")


def features_of(nodes: Iterable[NodeSpec], topics: Iterable[TopicSpec] | None = None) -> FeatureSet:
    """Derives the features of a robot, or of what one of its nodes subscribes to.

    The joints of the arm are ``observation.state`` and ``action``; with several arms the name of the node
    follows, as in ``observation.state.left_arm``. Pictures are ``observation.images.`` and the name of the
    camera without «camera»; what else is published is ``observation.`` and the name of its node or topic. A
    topic that an actuator subscribes to is a command and no observation. ``action`` comes from
    ``~/applied_command``, which says what was written after ramp and limits.

    Args:
        nodes: of the plan.
        topics: those that count, such as ``spec.subscriptions`` of a model: observations only, and topics
            that no node publishes count too, and a key that comes again gets a number; None for everything,
            actions included.

    Raises:
        ValueError: two nodes would have one key; the message names it.
    """
    robot = _Robot(nodes)
    if topics is None:
        return FeatureSet(robot.everything())
    seen: dict[str, Feature] = {}
    for topic in topics:
        feature = robot.observed(topic)
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

    def __init__(self, nodes: Iterable[NodeSpec]) -> None:
        self._nodes = tuple(nodes)
        self._actuators = [node for node in self._nodes if node.kind is NodeKind.ACTUATOR]
        self._commands = {topic.name for node in self._actuators for topic in node.subscriptions}
        self._arms = [
            node
            for node in self._actuators
            if node.role != LEADER and any(self._is_state(topic) for topic in node.publishers)
        ]
        self._publisher_of = {topic.name: node for node in self._nodes for topic in node.publishers}

    def everything(self) -> Iterable[Feature]:
        found: dict[str, Feature] = {}
        for node in self._nodes:
            if node.kind is NodeKind.SENSOR or node in self._arms:
                own: dict[str, Feature] = {}
                for topic in node.publishers:
                    if topic.name not in self._commands and topic.type_name not in _DESCRIPTIONS:
                        feature = self.observed(topic)
                        own.setdefault(feature.key, feature)  # a camera's raw and compressed pictures are one
                both = own.keys() & found.keys()
                if both:
                    raise ValueError(f"two nodes show {min(both)}: rename {node.full_name} or the other one")
                found |= own
        yield from found.values()
        for arm in self._arms:
            if arm.subscriptions:
                topic_name = f"{arm.full_name}/applied_command"
                yield Feature.joints(self._of_arm(ACTION, arm), _joints(arm), topic=topic_name)

    def observed(self, topic: TopicSpec) -> Feature:
        node = self._publisher_of.get(topic.name)
        settings = node.settings if node is not None else {}
        if topic.type_name in PICTURES:
            key = camera_key(node.full_name if node is not None else _shown_by(topic))
            height, width = (int(settings.get(side, 0)) for side in ("height", "width"))
            return Feature.picture(key, height, width, topic=topic.name)
        if topic.type_name == JOINT_STATE:
            if node in self._arms and self._is_state(topic):
                return Feature.joints(self._of_arm(STATE, node), _joints(node), topic=topic.name)
            names = tuple(settings.get("joint_names", ())) or (_joints(node) if node is not None else ())
            key = f"observation.{_plain(node.full_name if node is not None else _shown_by(topic))}"
            return Feature(key, "float32", (len(names),), names, "rad", topic.name)
        dtype, shape = _numbers(topic.type_name)
        return Feature(f"observation.{_shown_by(topic)}", dtype, shape, topic=topic.name)

    def _is_state(self, topic: TopicSpec) -> bool:
        return topic.type_name == JOINT_STATE and topic.name not in self._commands

    def _of_arm(self, key: str, arm: NodeSpec) -> str:
        return key if len(self._arms) == 1 else f"{key}.{_plain(arm.full_name)}"


def _joints(node: NodeSpec) -> tuple[str, ...]:
    return tuple(joint["name"] for joint in node.context.get("joints", ()))


def _plain(name: str) -> str:
    return name.strip("/").replace("/", "_")


def _shown_by(topic: TopicSpec) -> str:
    """What a topic shows, by its name: ``top`` of ``/top/image_raw``."""
    parts = topic.name.strip("/").split("/")
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

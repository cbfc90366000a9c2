from __future__ import annotations

from typing import Any

import pytest
from joshua.features import Feature, camera_key, features_of
from joshua.plan import NodeKind, NodeSpec, TopicSpec

JOINT_STATE, IMAGE = "sensor_msgs/msg/JointState", "sensor_msgs/msg/Image"
COMPRESSED = "sensor_msgs/msg/CompressedImage"


def topic(name: str, type_name: str = JOINT_STATE) -> TopicSpec:
    return TopicSpec(name=name, type_name=type_name, rate_hz=50.0)


def node(
    name: str, kind: NodeKind, *published: TopicSpec, heard: tuple[str, ...] = (), **more: Any
) -> NodeSpec:
    return NodeSpec(
        name=name,
        kind=kind,
        behaviour="",
        implementation="",
        publishers=published,
        subscriptions=tuple(topic(name) for name in heard),
        **more,
    )


def arm(name: str, *, heard: tuple[str, ...] = (), role: str = "ACTION_FOLLOWER", **more: Any) -> NodeSpec:
    joints = {"joints": [{"name": joint, "min_rad": -1.0, "max_rad": 1.0} for joint in ("pan", "gripper")]}
    states = topic(f"/{name}/joint_states")
    return node(name, NodeKind.ACTUATOR, states, heard=heard, role=role, context=joints, **more)


def camera(name: str, *published: TopicSpec) -> NodeSpec:
    return node(name, NodeKind.SENSOR, *published, settings={"width": 64, "height": 48})


LEADER = arm("leader", role="ACTION_LEADER")
FOLLOWER = arm("follower", heard=("/leader/joint_states",))
TOP = camera("camera_top", topic("/top/image_raw", IMAGE), topic("/top/compressed", COMPRESSED))


def test_a_teleoperation_rig_shows_its_follower_and_cameras_and_does_what_was_applied() -> None:
    info = topic("/top/camera_info", "sensor_msgs/msg/CameraInfo")
    wrist = camera("wrist", topic("/wrist/image_raw", IMAGE), info)
    assert list(features_of([LEADER, FOLLOWER, TOP, wrist]).values()) == [
        Feature.joints("observation.state", ("pan", "gripper"), topic="/follower/joint_states"),
        Feature.picture("observation.images.top", 48, 64, topic="/top/image_raw"),
        Feature.picture("observation.images.wrist", 48, 64, topic="/wrist/image_raw"),
        Feature.joints("action", ("pan", "gripper"), topic="/follower/applied_command"),
    ]


def test_two_arms_are_told_apart() -> None:
    arms = [arm("left_arm", heard=("/a",)), arm("right_arm", heard=("/b",))]
    assert list(features_of(arms)) == [
        "observation.state.left_arm",
        "observation.state.right_arm",
        "action.left_arm",
        "action.right_arm",
    ]


def test_other_sensors_are_columns_by_the_name_of_their_node_or_topic() -> None:
    encoder = node("wheel", NodeKind.SENSOR, topic("/wheel/joint_states"), settings={"joint_names": ["axle"]})
    lidar = node("lidar", NodeKind.SENSOR, topic("/front/scan", "sensor_msgs/msg/LaserScan"))
    pad = node("gamepad", NodeKind.SENSOR, topic("/leader/joint_states"))
    assert list(features_of([encoder, lidar, pad, FOLLOWER]).values()) == [
        Feature("observation.wheel", "float32", (1,), ("axle",), "rad", "/wheel/joint_states"),
        Feature("observation.front_scan", "float32", (0,), topic="/front/scan"),
        *features_of([FOLLOWER]).values(),
    ]


def test_a_model_sees_what_it_subscribes_to_and_in_that_order() -> None:
    seen = [
        topic("/top/compressed", COMPRESSED),
        topic("/follower/joint_states"),
        topic("/leader/joint_states"),
        topic("/elsewhere/camera/image_raw", IMAGE),
        topic("/count", "std_msgs/msg/Int64"),
        topic("/pressed", "std_msgs/msg/Bool"),
    ]
    features = features_of([LEADER, FOLLOWER, TOP], seen)
    assert [(feature.key, feature.shape, feature.dtype) for feature in features.values()] == [
        ("observation.images.top", (48, 64, 3), "uint8"),
        ("observation.state", (2,), "float32"),
        ("observation.leader", (2,), "float32"),
        ("observation.images.elsewhere", (0, 0, 3), "uint8"),
        ("observation.count", (1,), "int64"),
        ("observation.pressed", (1,), "bool"),
    ]
    assert features["observation.images.top"].topic == "/top/compressed"


def test_a_model_may_see_one_camera_twice() -> None:
    seen = features_of([TOP], TOP.publishers)
    assert list(seen) == ["observation.images.top", "observation.images.top_2"]


def test_two_cameras_of_one_name_are_refused() -> None:
    with pytest.raises(ValueError, match=r"two nodes show observation.images.top: rename /top_camera or the"):
        features_of([TOP, camera("top_camera", topic("/x", IMAGE))])


@pytest.mark.parametrize(
    ("name", "key"),
    [
        ("camera_top", "top"),
        ("/camera/top", "top"),
        ("top_camera", "top"),
        ("/left/camera_wrist", "left_wrist"),
        ("camera", "camera"),
    ],
)
def test_cameras_are_called_as_lerobot_calls_them(name: str, key: str) -> None:
    assert camera_key(name) == f"observation.images.{key}"

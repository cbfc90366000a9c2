from __future__ import annotations

from types import SimpleNamespace

import pytest
from google.protobuf import text_format
from joshua.config.graph import build_graph
from joshua.features import Feature, FeatureSet, camera_key, features_of
from joshua.schema import config_pb2 as pb
from joshua.schema import data_type_pb2

JOINTS = ("pan", "gripper")
CAMERA = SimpleNamespace(width=64, height=48)


def topic(name: str, data_type: str = "JOINT_STATE") -> str:
    return f'{{ data_type: {data_type} topic_name: "{name}" }}'


def node(name: str, *published: str, heard: tuple[str, ...] = ()) -> str:
    topics = [f"publishers {item}" for item in published] + [f"subscriptions {item}" for item in heard]
    return f'node {{ node_name: "{name}" {" ".join(topics)} }}'


def arm(name: str, *heard: str, role: str = "ACTION_FOLLOWER") -> str:
    inner = node(name, topic(f"/{name}/joint_states"), heard=tuple(topic(name) for name in heard))
    return f"robot {{ actions {{ {inner} action_type: {role} }} }}"


def sensor(name: str, *published: str) -> str:
    return f"robot {{ perceptions {{ {node(name, *published)} }} }}"


def derived(*blocks: str, model: str = "") -> FeatureSet:
    config = pb.Config()
    for block in (*blocks, model):
        text_format.Merge(block, config)
    graph = build_graph(config)
    settings = {
        entry.path: SimpleNamespace(joint_names=("axle",)) if entry.node.node_name == "wheel" else CAMERA
        for entry in graph.entries
        if entry.is_sensor
    }
    joints = {entry.path: JOINTS for entry in graph.actuators}
    return features_of(graph, joints, settings, reader=graph.models[0] if model else None)


LEADER = arm("leader", role="ACTION_LEADER")
FOLLOWER = arm("follower", "/leader/joint_states")
TOP = sensor("camera_top", topic("/top/image_raw", "IMAGE"), topic("/top/compressed", "COMPRESSED_IMAGE"))


def test_a_teleoperation_rig_shows_its_follower_and_cameras_and_does_what_was_applied() -> None:
    wrist = sensor("wrist", topic("/wrist/image_raw", "IMAGE"), topic("/wrist/camera_info", "CAMERA_INFO"))
    assert list(derived(LEADER, FOLLOWER, TOP, wrist).values()) == [
        Feature.joints("observation.state", JOINTS, topic="/follower/joint_states"),
        Feature.picture("observation.images.top", 48, 64, topic="/top/image_raw"),
        Feature.picture("observation.images.wrist", 48, 64, topic="/wrist/image_raw"),
        Feature.joints("action", JOINTS, topic="/follower/applied_command"),
    ]


def test_two_arms_are_told_apart() -> None:
    assert list(derived(arm("left_arm", "/a"), arm("right_arm", "/b"))) == [
        "observation.state.left_arm",
        "observation.state.right_arm",
        "action.left_arm",
        "action.right_arm",
    ]


def test_other_sensors_are_columns_by_the_name_of_their_node_or_topic() -> None:
    wheel = sensor("wheel", topic("/wheel/joint_states"))
    lidar = sensor("lidar", topic("/front/scan", "LASER_SCAN"))
    pad = sensor("gamepad", topic("/leader/joint_states"))
    features = derived(wheel, lidar, pad, FOLLOWER)
    assert list(features) == ["observation.state", "observation.wheel", "observation.front_scan", "action"]
    assert features["observation.wheel"] == Feature.joints(
        "observation.wheel", ("axle",), topic="/wheel/joint_states"
    )
    assert features["observation.front_scan"].shape == (0,)


def model(*heard: str) -> str:
    return f"ai {{ models {{ {node('policy', heard=heard)} }} }}"


def test_a_model_sees_what_it_subscribes_to_and_in_that_order() -> None:
    seen = model(
        topic("/top/compressed", "COMPRESSED_IMAGE"),
        topic("/follower/joint_states"),
        topic("/leader/joint_states"),
        topic("/elsewhere/camera/image_raw", "IMAGE"),
        topic("/count", "INT64"),
        topic("/pressed", "BOOL"),
    )
    features = derived(LEADER, FOLLOWER, TOP, model=seen)
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
    seen = model(topic("/top/image_raw", "IMAGE"), topic("/top/compressed", "COMPRESSED_IMAGE"))
    assert list(derived(TOP, model=seen)) == ["observation.images.top", "observation.images.top_2"]


def test_two_cameras_of_one_name_are_refused() -> None:
    with pytest.raises(ValueError, match=r"nodes provide observation.images.top: rename /top_camera or the"):
        derived(TOP, sensor("top_camera", topic("/x", "IMAGE")))


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


def test_an_arm_that_a_person_takes_over_from_a_model_says_when() -> None:
    guide = """robot { actions { action_type: ACTION_LEADER node { node_name: "guide"
        publishers { data_type: JOINT_STATE topic_name: "/go" override: true } } } }"""
    policy = """ai { models { node { node_name: "policy"
        publishers { data_type: JOINT_STATE topic_name: "/go" } } } }"""
    told = Feature("intervention", "bool", (1,), topic="/follower/intervention")
    follower = arm("follower", "/go")
    config = pb.Config()
    for block in (follower, policy, guide):
        text_format.Merge(block, config)
    graph = build_graph(config)
    joints = {entry.path: JOINTS for entry in graph.actuators}
    assert features_of(graph, joints, {})["intervention"] == told
    assert graph.published["/follower/intervention"] == data_type_pb2.BOOL
    assert "intervention" not in derived(follower, policy.replace("policy", "other"))

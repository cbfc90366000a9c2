"""A recording of messages, played by ROS 2's own rclpy: rosbag2 itself is on no package index."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from joshua.messages import encode, type_hash
from joshua.messages.make import image, joint_state
from joshua_dataset.bag import Bag
from rosbags.rosbag2 import Reader

STATES, TOP = "/arm/joint_states", "/top/image_raw"
T0 = 1_700_000_000_000_000_000


def test_a_recording_is_played_by_ros_2(peer: Any, eventually: Any, share: Path, tmp_path: Path) -> None:
    picture = np.arange(4 * 6 * 3, dtype=np.uint8).reshape(4, 6, 3)
    bag = Bag(tmp_path / "episode")
    for number in range(5):
        at_ns = T0 + number * 20_000_000
        state = encode(joint_state(("pan", "gripper"), [number / 10, 1.0], at_ns=at_ns))
        bag.add(STATES, "sensor_msgs/msg/JointState", state, at_ns + 500, at_ns)
    bag.add(TOP, "sensor_msgs/msg/Image", encode(image(picture, at_ns=T0)), T0, T0)
    bag.close()

    with Reader(tmp_path / "episode") as reader:
        played: dict[str, list[str]] = {STATES: [], TOP: []}
        for connection, _, data in reader.messages():
            played[connection.topic].append(bytes(data).hex())
    assert [len(found) for found in played.values()] == [5, 1]
    peer.watch_joints(STATES)
    assert peer.play_messages(STATES, "sensor_msgs/msg/JointState", played[STATES])
    eventually(lambda: peer.texts(STATES) == {"pan": 0.4, "gripper": 1.0}, what="the last state")
    shown = peer.deserialised("sensor_msgs/msg/Image", played[TOP][0])
    assert (shown["height"], shown["width"], shown["encoding"]) == (4, 6, "rgb8")
    assert shown["data"] == picture.ravel().tolist()

    # rosbag2 compares the types by the hashes in its metadata
    described = json.loads((tmp_path / "episode/metadata.yaml").read_text())["rosbag2_bagfile_information"]
    for topic in described["topics_with_message_count"]:
        kind = topic["topic_metadata"]["type"]
        of_ros = json.loads((share / f"{kind}.json").read_text())["type_hashes"]
        hashes = {item["type_name"]: item["hash_string"] for item in of_ros}
        assert topic["topic_metadata"]["type_description_hash"] == hashes[kind] == type_hash(kind)

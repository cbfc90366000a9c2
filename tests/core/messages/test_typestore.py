"""Type names, hashes and the distributions."""

from __future__ import annotations

from typing import Any

import pytest
from joshua.messages import (
    MessageError,
    dds_type_name,
    decode,
    distro,
    encode,
    known_types,
    message_class,
    ros_type_name,
    select_distro,
    type_hash,
)
from joshua.messages.fields import build


@pytest.fixture(autouse=True)
def _restore_distro():
    before = distro()
    yield
    select_distro(before)


@pytest.mark.parametrize(
    "spelling",
    ["sensor_msgs/msg/JointState", "sensor_msgs/JointState", "sensor_msgs::msg::dds_::JointState_"],
)
def test_every_spelling_of_a_type_is_understood(spelling):
    assert ros_type_name(spelling) == "sensor_msgs/msg/JointState"
    assert dds_type_name(spelling) == "sensor_msgs::msg::dds_::JointState_"
    assert message_class(spelling).__msgtype__ == "sensor_msgs/msg/JointState"


@pytest.mark.parametrize("name", ["JointState", "sensor_msgs/", "a/b/c/d", ""])
def test_a_name_of_another_form_is_refused(name):
    with pytest.raises(MessageError, match="write it as package/msg/Type"):
        ros_type_name(name)


def test_the_nearest_types_are_named():
    with pytest.raises(MessageError, match="the nearest are sensor_msgs/msg/JointState"):
        message_class("sensor_msgs/msg/JointStates")


def test_hashes_are_those_of_jazzy():
    # as ros2 topic info --verbose prints them
    assert type_hash("std_msgs/msg/String") == (
        "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
    )
    assert type_hash("std_msgs/msg/Empty") == (
        "RIHS01_20b625256f32d5dbc0d04fee44f43c41e51c70d3502f84b4a08e7a9c26a96312"
    )


def test_humble_has_its_own_range_and_no_hashes():
    jazzy = message_class("sensor_msgs/msg/Range").__dataclass_fields__
    select_distro("humble")
    humble = message_class("sensor_msgs/msg/Range").__dataclass_fields__
    assert "variance" in jazzy
    assert "variance" not in humble
    assert type_hash("sensor_msgs/msg/Range") == "TypeHashNotSupported"


def test_later_distributions_share_the_definitions_of_jazzy():
    jazzy = message_class("sensor_msgs/msg/Image")
    select_distro("Kilted")
    assert message_class("sensor_msgs/msg/Image") is jazzy


def test_the_data_types_are_all_known():
    assert len(known_types()) > 106


# From the type descriptions that ROS 2 Jazzy installs (share/<package>/msg/<Type>.json); char is uint8 there.
JAZZY_HASHES = {
    "std_msgs/msg/Byte": "RIHS01_41e1a3345f73fe93ede006da826a6ee274af23dd4653976ff249b0f44e3e798f",
    "std_msgs/msg/Char": "RIHS01_3ad2d04dd29ba19d04b16659afa3ccaedd691914b02a64e82e252f2fa6a586a9",
    "rmw_dds_common/msg/ParticipantEntitiesInfo": "RIHS01_"
    "91a0593bacdcc50ea9bdcf849a938b128412cc1ea821245c663bcd26f83c295e",
}


@pytest.mark.parametrize("name", JAZZY_HASHES)
def test_octets_are_hashed_as_ros_2_hashes_them(name):
    select_distro("jazzy")
    assert type_hash(name) == JAZZY_HASHES[name]


@pytest.mark.parametrize("name", ["std_msgs/msg/Byte", "std_msgs/msg/Char"])
def test_octets_are_unsigned(name):
    message = build(name, {"data": 200})
    assert message.data == 200
    assert bytes(encode(message))[4] == 200
    assert decode(name, encode(message)).data == 200


@pytest.mark.parametrize("name", ["jazzy", "humble"])
def test_a_message_is_made_of_what_is_given_and_zeros_on_every_distribution(name):
    select_distro(name)
    state = message_class("sensor_msgs/msg/JointState")(name=["a"], position=[0.5])
    back = decode("sensor_msgs/msg/JointState", encode(state))
    assert (back.name, list(back.position), len(back.velocity), back.header.frame_id) == (["a"], [0.5], 0, "")
    # a field that Jazzy added
    ranged = message_class("sensor_msgs/msg/Range")(range=1.5, variance=0.25)
    assert decode("sensor_msgs/msg/Range", encode(ranged)).range == 1.5
    info = message_class("sensor_msgs/msg/CameraInfo")()
    assert (len(info.k), info.roi.do_rectify) == (9, False)
    info.k[0] = 1.0
    assert message_class("sensor_msgs/msg/CameraInfo")().k[0] == 0.0


def test_the_modules_of_rosbags_are_left_alone():
    from rosbags.typesys.stores import ros2_jazzy

    theirs: Any = ros2_jazzy.geometry_msgs__msg__Pose
    ours = message_class("geometry_msgs/msg/Pose")
    assert ours is not theirs
    assert [*theirs.__dataclass_fields__] == [*ours.__dataclass_fields__]
    with pytest.raises(TypeError, match="missing"):
        theirs()  # ours takes defaults
    assert ours().orientation.w == 0.0

"""Type names, hashes and the distributions."""

from __future__ import annotations

import pytest
from joshua.messages import (
    MessageError,
    dds_type_name,
    distro,
    known_types,
    message_class,
    ros_type_name,
    select_distro,
    type_hash,
)


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

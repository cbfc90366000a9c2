"""The DataType enum: 106 types, their numbers, and the two other spellings."""

from __future__ import annotations

import re

import pytest
from joshua.schema import data_types
from joshua.schema.data_type_pb2 import DataType


def test_each_number_from_1_to_106_names_one_ros_type() -> None:
    names = [data_types.type_name(number) for number in range(1, 107)]
    assert len(set(names)) == 106
    assert all(re.fullmatch(r"[a-z0-9_]+/msg/[A-Z][A-Za-z0-9]*", name) for name in names)
    assert data_types.type_names() == tuple(names)
    assert max(DataType.values()) == 106


@pytest.mark.parametrize(
    ("enum_name", "type_name", "number"),
    [
        ("DURATION", "builtin_interfaces/msg/Duration", 1),
        ("POSE_2D", "geometry_msgs/msg/Pose2D", 18),
        ("POSE2D", "geometry_msgs/msg/Pose2D", 18),
        ("IMAGE", "sensor_msgs/msg/Image", 48),
        ("JOINT_STATE", "sensor_msgs/msg/JointState", 50),
        ("POINT_CLOUD2", "sensor_msgs/msg/PointCloud2", 62),
        ("POINTCLOUD2", "sensor_msgs/msg/PointCloud2", 62),
        ("TF_MESSAGE", "tf2_msgs/msg/TFMessage", 99),
        ("MARKER_ARRAY", "visualization_msgs/msg/MarkerArray", 106),
    ],
)
def test_names_and_numbers_agree(enum_name: str, type_name: str, number: int) -> None:
    assert DataType.Value(enum_name) == number
    assert data_types.type_name(number) == type_name
    assert data_types.number(type_name) == number
    assert data_types.number(enum_name) == number
    assert enum_name in data_types.enum_names(number)


def test_each_enum_name_is_the_type_name_in_upper_case() -> None:
    for number in range(1, 107):
        short = data_types.type_name(number).rpartition("/")[2]
        for enum_name in data_types.enum_names(number):
            assert enum_name.replace("_", "") == short.upper()


def test_other_spellings_follow_the_main_name() -> None:
    assert data_types.enum_names(18) == ("POSE_2D", "POSE2D")
    assert data_types.enum_names(62) == ("POINT_CLOUD2", "POINTCLOUD2")


@pytest.mark.parametrize("number", [0, -1, 107])
def test_a_number_without_a_type_is_refused(number: int) -> None:
    with pytest.raises(ValueError, match=f"{number} is not the number of a ROS 2 type"):
        data_types.type_name(number)


@pytest.mark.parametrize("name", ["sensor_msgs/msg/Nothing", "DATA_TYPE_UNSPECIFIED", "image", ""])
def test_an_unknown_name_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match="has no type"):
        data_types.number(name)


def test_names_of_an_unknown_number_are_refused() -> None:
    with pytest.raises(ValueError, match="107 is not a number"):
        data_types.enum_names(107)

"""Messages as text, and plain values as messages."""

from __future__ import annotations

import math

import numpy as np
import pytest
from joshua.messages import MessageError, decode, encode
from joshua.messages.fields import build, fields, to_plain
from joshua.messages.text import message_text
from ruamel.yaml import YAML


def test_text_is_yaml_and_reads_back_as_the_message():
    values = {
        "header": {"stamp": {"sec": 3, "nanosec": 4}, "frame_id": "true"},
        "status": [
            {"level": 200, "name": "motor: 1", "message": "", "values": [{"key": "a", "value": "b c"}]},
            {"level": 1, "name": "ä", "message": "- x", "hardware_id": "/dev/ttyACM0"},
        ],
    }
    message = build("diagnostic_msgs/msg/DiagnosticArray", values)
    read = YAML(typ="safe", pure=True).load(message_text(message))
    assert bytes(encode(build("diagnostic_msgs/msg/DiagnosticArray", read))) == bytes(encode(message))


def test_special_numbers_and_widths():
    text = message_text(
        build("std_msgs/msg/Float32MultiArray", {"data": [0.1, math.nan, math.inf, -math.inf]})
    )
    assert text.endswith("data: [0.1, .nan, .inf, -.inf]\n")
    decoded = decode("std_msgs/msg/Float32", encode(build("std_msgs/msg/Float32", {"data": 0.1})))
    assert message_text(decoded) == "data: 0.1\n"


def test_text_from_a_network_commands_no_terminal():
    found = message_text(build("std_msgs/msg/String", {"data": "\x1b[31m \x9b2J ‮ evil é"}))
    assert found == 'data: "\\u001b[31m \\u009b2J \\u202e evil é"\n'
    assert YAML(typ="safe", pure=True).load(found) == {"data": "\x1b[31m \x9b2J ‮ evil é"}


def test_messages_without_fields():
    assert message_text(build("std_msgs/msg/Empty")) == "{}\n"
    assert to_plain(build("std_msgs/msg/Empty")) == {}


def test_long_lists_are_shortened():
    path = build("nav_msgs/msg/Path", {"poses": [{} for _ in range(30)]})
    assert "# 30 in all" in message_text(path)
    assert "# 30 in all" not in message_text(path, full=True)


def test_what_is_left_out_is_zero():
    image = build("sensor_msgs/msg/CameraInfo", {"width": 3})
    assert image.width == 3
    assert image.k.tolist() == [0.0] * 9
    assert image.header.frame_id == ""


def test_stamps_of_the_moment():
    message = build("sensor_msgs/msg/JointState", {"header": "auto"})
    assert message.header.stamp.sec > 1_600_000_000
    assert build("std_msgs/msg/Header", {"stamp": "now"}).stamp.sec > 1_600_000_000


@pytest.mark.parametrize(
    ("type_name", "values", "text"),
    [
        (
            "geometry_msgs/msg/Twist",
            {"linar": {}},
            "has no field 'linar'; it has linear, angular; did you mean linear",
        ),
        (
            "geometry_msgs/msg/Twist",
            {"linear": {"q": 1}},
            "linear: geometry_msgs/msg/Vector3 has no field 'q'",
        ),
        ("geometry_msgs/msg/Twist", [1], r"a mapping of the fields of geometry_msgs/msg/Twist"),
        ("std_msgs/msg/Empty", {"a": 1}, "it has no fields"),
        ("sensor_msgs/msg/JointState", {"name": "a"}, r"name: found 'a'; it takes a list for string\[\]"),
        ("sensor_msgs/msg/JointState", {"position": [1, "x"]}, r"position\[1\]: found 'x'"),
        ("sensor_msgs/msg/JointState", {"position": np.zeros((2, 2))}, r"one dimension \(float64\[\]\)"),
        ("geometry_msgs/msg/PoseWithCovariance", {"covariance": [1.0]}, "exactly 36 values"),
        ("std_msgs/msg/Float32", {"data": 1e300}, "within the range of float32"),
        ("std_msgs/msg/Int8", {"data": 1.5}, "a whole number from -128 to 127"),
        ("std_msgs/msg/Bool", {"data": 1}, "true or false"),
        (
            "tf2_msgs/msg/TFMessage",
            {"transforms": [{"child": 1}]},
            r"transforms\[0\]: .*did you mean child_frame_id",
        ),
    ],
)
def test_values_that_do_not_fit_name_place_and_remedy(type_name, values, text):
    with pytest.raises(MessageError, match=text):
        build(type_name, values)


def test_fields_describe_a_type():
    names = {field.wire_name: field.text for field in fields("sensor_msgs/msg/CameraInfo")}
    assert names["header"] == "std_msgs/Header"
    assert names["k"] == "float64[9]"
    assert names["d"] == "float64[]"


def test_octets_count_from_0_to_255():
    message = build("std_msgs/msg/ByteMultiArray", {"data": b"\x00\x80\xff"})
    assert to_plain(decode("std_msgs/msg/ByteMultiArray", encode(message)))["data"].tolist() == [0, 128, 255]

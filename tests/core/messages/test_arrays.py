from __future__ import annotations

import sys

import numpy as np
import pytest
from joshua.messages import MessageError, message_class
from joshua.messages.arrays import acquired_ns, array_of, holds_numbers, load_decoder, picture
from joshua.messages.fields import build
from joshua.messages.make import header, image, joint_state

RGB = np.arange(2 * 3 * 3, dtype=np.uint8).reshape(2, 3, 3)


@pytest.mark.parametrize(
    ("pixels", "encoding"),
    [
        (RGB, "rgb8"),
        (RGB[:, :, ::-1], "bgr8"),
        (np.dstack((RGB, RGB[:, :, 0])), "rgba8"),
        (np.dstack((RGB[:, :, ::-1], RGB[:, :, 0])), "bgra8"),
    ],
)
def test_pictures_are_rgb(pixels: np.ndarray, encoding: str) -> None:
    shown = array_of(image(np.ascontiguousarray(pixels), encoding))
    assert shown.dtype == np.uint8
    assert (shown == RGB).all()


def test_grey_has_three_equal_channels() -> None:
    assert (picture(image(RGB[:, :, 0], "mono8")) == np.repeat(RGB[:, :, :1], 3, axis=2)).all()


def test_depth_is_no_picture() -> None:
    with pytest.raises(MessageError, match="an image of encoding '16UC1' has no colours: publish rgb8"):
        picture(image(RGB[:, :, 0].astype(np.uint16), "16UC1"))


@pytest.mark.parametrize("ending", [".png", ".jpg"])
def test_compressed_pictures_are_decoded(ending: str) -> None:
    cv2 = pytest.importorskip("cv2")
    red = np.zeros((32, 32, 3), np.uint8)
    red[:, :, 0] = 200
    data = cv2.imencode(ending, red[:, :, ::-1])[1]
    message = message_class("sensor_msgs/msg/CompressedImage")(header(), ending[1:], data)
    shown = picture(message)
    assert shown.shape == (32, 32, 3)
    assert np.abs(shown.astype(int) - red).max() <= 3
    broken = message_class("sensor_msgs/msg/CompressedImage")(header(), "jpeg", data[:20])
    with pytest.raises(MessageError, match=r"a compressed image \(jpeg\) cannot be decoded"):
        picture(broken)


def test_a_missing_decoder_names_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cv2", None)
    load_decoder.cache_clear()
    with pytest.raises(MessageError, match="pip install opencv-python-headless"):
        load_decoder()


def test_joints_come_in_the_wanted_order() -> None:
    message = joint_state(["a", "b", "c"], [1.0, 2.0, 3.0])
    assert array_of(message).tolist() == [1.0, 2.0, 3.0]
    assert array_of(message, ("c", "a")).tolist() == [3.0, 1.0]
    with pytest.raises(MessageError, match="positions of a, b, c, and d are wanted"):
        array_of(message, ("d",))
    with pytest.raises(MessageError, match="positions of a, and a, b are wanted"):
        array_of(joint_state(["a"], []), ("a", "b"))


@pytest.mark.parametrize(
    ("type_name", "values", "numbers"),
    [
        ("std_msgs/msg/Int64", {"data": 7}, [7]),
        ("std_msgs/msg/Bool", {"data": True}, [True]),
        ("std_msgs/msg/Float32MultiArray", {"data": [1.5, 2.5]}, [1.5, 2.5]),
        (
            "geometry_msgs/msg/Twist",
            {"linear": {"x": 1.0}, "angular": {"z": 2.0}},
            [1.0, 0.0, 0.0, 0.0, 0.0, 2.0],
        ),
        ("sensor_msgs/msg/LaserScan", {"ranges": [0.5, 1.0], "angle_min": 3.0}, [0.5, 1.0]),
    ],
)
def test_other_messages_are_their_numbers(type_name: str, values: dict, numbers: list) -> None:
    assert array_of(build(type_name, values)).tolist() == numbers
    assert holds_numbers(type_name)


def test_a_text_has_no_numbers() -> None:
    assert not holds_numbers("std_msgs/msg/String")
    with pytest.raises(MessageError, match="std_msgs/msg/String holds no number"):
        array_of(build("std_msgs/msg/String", {"data": "a"}))


def test_the_stamp_of_the_header_counts_where_there_is_one() -> None:
    assert acquired_ns(joint_state(["a"], [1.0], at_ns=5), 9) == 5
    assert acquired_ns(joint_state(["a"], [1.0], at_ns=0), 9) == 9
    assert acquired_ns(build("std_msgs/msg/Int64"), 9) == 9

"""Fast paths are byte-identical to rosbags, both ways, and malformed payloads are refused."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from joshua.messages import MessageError, decode, encode, message_class, preload
from joshua.messages.fields import fields
from joshua.messages.typestore import typestore
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore

JOINT_STATE = "sensor_msgs/msg/JointState"
IMAGE = "sensor_msgs/msg/Image"
COMPRESSED = "sensor_msgs/msg/CompressedImage"

PEER = get_typestore(Stores.ROS2_JAZZY)

texts = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)
stamps = st.tuples(st.integers(-(2**31), 2**31 - 1), st.integers(0, 2**32 - 1))
floats = hnp.arrays(np.float64, st.integers(0, 9), elements=st.floats(width=64))


def header(stamp, frame_id):
    time = message_class("builtin_interfaces/msg/Time")(*stamp)
    return message_class("std_msgs/msg/Header")(time, frame_id)


def strided(array):
    """The same numbers, not contiguous in memory."""
    wide = np.repeat(array, 2)
    return wide[::2]


@st.composite
def joint_states(draw):
    return message_class(JOINT_STATE)(
        header(draw(stamps), draw(texts)),
        draw(st.lists(texts, max_size=8)),
        *(draw(floats) for _ in range(3)),
    )


@st.composite
def images(draw):
    small = st.integers(0, 2**32 - 1)
    data = draw(hnp.arrays(np.uint8, st.integers(0, 300)))
    return message_class(IMAGE)(
        header(draw(stamps), draw(texts)), draw(small), draw(small), draw(texts), draw(st.integers(0, 255)),
        draw(small), data,
    )  # fmt: skip


@st.composite
def compressed_images(draw):
    data = draw(hnp.arrays(np.uint8, st.integers(0, 300)))
    return message_class(COMPRESSED)(header(draw(stamps), draw(texts)), draw(texts), data)


def plain(message):
    """A message as comparable values."""
    if hasattr(message, "__msgtype__"):
        values = {field.name: getattr(message, field.name) for field in fields(message.__msgtype__)}
        return {name: plain(value) for name, value in values.items()}
    return message.tobytes() if isinstance(message, np.ndarray) else message


@settings(max_examples=200, deadline=None)
@given(st.one_of(joint_states(), images(), compressed_images()))
def test_writing_equals_rosbags(message):
    assert bytes(encode(message)) == bytes(PEER.serialize_cdr(message, message.__msgtype__))


@settings(max_examples=200, deadline=None)
@given(st.one_of(joint_states(), images(), compressed_images()), st.booleans())
def test_reading_equals_rosbags_in_both_byte_orders(message, little_endian):
    name = message.__msgtype__
    cdr = PEER.serialize_cdr(message, name, little_endian=little_endian)
    ours, theirs = decode(name, cdr), PEER.deserialize_cdr(cdr, name)
    assert type(ours).__name__ == type(theirs).__name__
    assert plain(ours) == plain(theirs)


@settings(max_examples=100, deadline=None)
@given(joint_states())
def test_strided_arrays_are_written_in_order(message):
    expected = bytes(encode(message))
    for field in ("position", "velocity", "effort"):
        setattr(message, field, strided(getattr(message, field)))
    assert bytes(encode(message)) == expected


@settings(max_examples=300, deadline=None)
@given(st.one_of(joint_states(), images(), compressed_images()), st.data())
def test_damaged_payloads_are_read_as_rosbags_reads_them_or_refused(message, data):
    name = message.__msgtype__
    cdr = bytearray(encode(message))
    cut = data.draw(st.integers(0, len(cdr)))
    damaged = cdr[:cut] if data.draw(st.booleans()) else cdr
    for _ in range(data.draw(st.integers(0, 3))):
        if damaged:
            damaged[data.draw(st.integers(0, len(damaged) - 1))] = data.draw(st.integers(0, 255))
    try:
        theirs = plain(PEER.deserialize_cdr(bytes(damaged), name))
    except (SerdeError, IndexError):
        with pytest.raises(MessageError, match=name):
            decode(name, bytes(damaged))
        return
    assert plain(decode(name, bytes(damaged))) == theirs


@pytest.mark.parametrize("shape", [(4, 5, 3), (4, 5), (60,)])
def test_images_take_pixels_of_any_shape(shape):
    pixels = np.arange(np.prod(shape), dtype=np.uint8).reshape(shape)
    message = message_class(IMAGE)(header((1, 2), "cam"), 4, 5, "rgb8", 0, 15, pixels)
    flat = message_class(IMAGE)(header((1, 2), "cam"), 4, 5, "rgb8", 0, 15, pixels.reshape(-1))
    assert bytes(encode(message)) == bytes(PEER.serialize_cdr(flat, IMAGE))


def test_crops_of_an_image_are_written_row_by_row():
    frame = np.arange(8 * 10 * 3, dtype=np.uint8).reshape(8, 10, 3)
    crop = frame[2:6, 1:6]
    message = message_class(IMAGE)(header((1, 2), "cam"), 4, 5, "rgb8", 0, 15, crop)
    assert decode(IMAGE, encode(message)).data.tobytes() == crop.tobytes()


def test_image_data_is_a_view_of_the_payload():
    message = message_class(IMAGE)(header((1, 2), ""), 2, 2, "mono8", 0, 2, np.arange(4, dtype=np.uint8))
    payload = bytearray(encode(message))
    read = decode(IMAGE, payload)
    payload[-1] = 77
    assert read.data[-1] == 77


@pytest.mark.parametrize("name", [JOINT_STATE, "geometry_msgs/msg/Twist"])
def test_an_empty_payload_is_refused(name):
    with pytest.raises(MessageError, match=f"a payload of 0 bytes is no {name}"):
        decode(name, b"")


def test_an_unknown_encapsulation_is_refused():
    with pytest.raises(MessageError, match="encapsulation"):
        decode(JOINT_STATE, b"\x00\x07\x00\x00" + bytes(60))


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"position": ["a"]}, "JointState.position takes float64"),
        ({"position": np.zeros((2, 2))}, r"shape \(2, 2\)"),
        ({"name": [3]}, "JointState cannot be serialised"),
        ({"name": ["\ud800"]}, "UTF-8"),
    ],
)
def test_joint_state_fields_that_do_not_fit_are_named(change, text):
    values = {"name": ["a"], "position": np.zeros(1), "velocity": np.zeros(0), "effort": np.zeros(0)} | change
    message = message_class(JOINT_STATE)(header((0, 0), ""), **values)
    with pytest.raises(MessageError, match=text):
        encode(message)


def test_numbers_of_another_type_are_converted_not_reinterpreted():
    layout = message_class("std_msgs/msg/MultiArrayLayout")([], 0)
    message = message_class("std_msgs/msg/Float64MultiArray")(layout, np.array([1, 2, 3]))
    assert decode("std_msgs/msg/Float64MultiArray", encode(message)).data.tolist() == [1.0, 2.0, 3.0]


def test_lists_serve_for_arrays():
    covariance = message_class("geometry_msgs/msg/AccelWithCovariance")
    vector = message_class("geometry_msgs/msg/Vector3")
    accel = message_class("geometry_msgs/msg/Accel")(vector(0, 0, 0), vector(0, 0, 0))
    read = decode("geometry_msgs/msg/AccelWithCovariance", encode(covariance(accel, [0.5] * 36)))
    assert read.covariance.tolist() == [0.5] * 36


def test_a_field_of_the_wrong_kind_is_named():
    vector = message_class("geometry_msgs/msg/Vector3")(1.0, "high", 2.0)
    with pytest.raises(MessageError, match="y: found 'high'; it takes a number"):
        encode(vector)


def test_what_is_no_message_is_refused():
    with pytest.raises(MessageError, match="int is not a ROS 2 message"):
        encode(3)


def test_what_was_preloaded_is_compiled_before_the_first_message(monkeypatch):
    name = "sensor_msgs/msg/BatteryState"
    cache = typestore().cache
    monkeypatch.delitem(cache, name, raising=False)
    preload((name,))
    assert name in cache

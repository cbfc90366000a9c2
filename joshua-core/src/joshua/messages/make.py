"""Shortcuts for stamps, headers and the messages that every robot sends."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from joshua.messages.typestore import MessageError, message_class

_NS_PER_S = 1_000_000_000
_CHANNELS = {"rgb8": 3, "bgr8": 3, "rgba8": 4, "bgra8": 4, "mono8": 1, "mono16": 2, "16UC1": 2, "32FC1": 4}


def stamp(stamp_ns: int | None = None) -> Any:
    """A ``builtin_interfaces/msg/Time``.

    Args:
        stamp_ns: ns since the epoch; None for the time of the call.
    """
    sec, nanosec = divmod(time.time_ns() if stamp_ns is None else stamp_ns, _NS_PER_S)
    return message_class("builtin_interfaces/msg/Time")(sec, nanosec)


def stamp_ns(time_message: Any) -> int:
    """Nanoseconds since the epoch of a ``builtin_interfaces/msg/Time`` or ``Duration``."""
    return int(time_message.sec) * _NS_PER_S + int(time_message.nanosec)


def header(frame_id: str = "", at_ns: int | None = None) -> Any:
    """A ``std_msgs/msg/Header``. ``at_ns`` is the ``stamp_ns`` of ``stamp``."""
    return message_class("std_msgs/msg/Header")(stamp(at_ns), frame_id)


def joint_state(
    names: Sequence[str],
    position_rad: Any,
    velocity_rad_s: Any = (),
    effort: Any = (),
    *,
    frame_id: str = "",
    at_ns: int | None = None,
) -> Any:
    """A ``sensor_msgs/msg/JointState``.

    Args:
        names: joint names, N of them.
        position_rad: N numbers, or empty.
        velocity_rad_s: N numbers, or empty.
        effort: N numbers, or empty.
        frame_id: frame of the header.
        at_ns: acquisition time, ns since the epoch; None for the time of the call.

    Raises:
        MessageError: an array is neither empty nor of length N.
    """
    arrays = []
    for label, values in (
        ("position_rad", position_rad),
        ("velocity_rad_s", velocity_rad_s),
        ("effort", effort),
    ):
        array = np.ascontiguousarray(values, np.float64)
        if array.shape not in ((len(names),), (0,)):
            raise MessageError(f"{label} has shape {array.shape}; {len(names)} joints need ({len(names)},)")
        arrays.append(array)
    return message_class("sensor_msgs/msg/JointState")(header(frame_id, at_ns), list(names), *arrays)


def image(pixels: Any, encoding: str = "rgb8", *, frame_id: str = "", at_ns: int | None = None) -> Any:
    """A ``sensor_msgs/msg/Image`` that references the pixels. Serialising it copies them.

    Args:
        pixels: (H, W) or (H, W, C) array; uint8 for the 8-bit encodings.
        encoding: ROS 2 image encoding, such as ``rgb8``.
        frame_id: frame of the header.
        at_ns: acquisition time, ns since the epoch; None for the time of the call.

    Raises:
        MessageError: the shape does not fit the encoding.
    """
    array = np.ascontiguousarray(pixels)
    if array.ndim not in (2, 3):
        raise MessageError(f"pixels have shape {array.shape}; an image takes (H, W) or (H, W, C)")
    height, width = array.shape[:2]
    step = array.nbytes // height if height else 0
    if encoding in _CHANNELS and step != width * _CHANNELS[encoding]:
        raise MessageError(
            f"pixels of shape {array.shape} and type {array.dtype} are no {encoding} image, "
            f"which has {_CHANNELS[encoding]} bytes a pixel"
        )
    data = array.reshape(-1).view(np.uint8)
    return message_class("sensor_msgs/msg/Image")(
        header(frame_id, at_ns), height, width, encoding, 0, step, data
    )


def pixels(image_message: Any) -> Any:
    """View the pixels of an Image as an array of shape (H, W) or (H, W, C).

    Raises:
        MessageError: the encoding is not supported, or the data is shorter than width, height and step
        require.
    """
    wide = {"mono16": np.uint16, "16UC1": np.uint16, "32FC1": np.float32}
    height, width, step = image_message.height, image_message.width, image_message.step
    if image_message.encoding not in _CHANNELS:
        known = ", ".join(_CHANNELS)
        raise MessageError(f"images of encoding {image_message.encoding!r} have no array form; {known} have")
    row = width * _CHANNELS[image_message.encoding]
    data = np.asarray(image_message.data)
    if step < row or data.size < step * height:
        raise MessageError(
            f"an image of {width} × {height} {image_message.encoding} with a step of {step} bytes needs "
            f"{max(step, row) * height} bytes; it has {data.size}"
        )
    rows = data[: step * height].reshape(height, step)[:, :row]
    if image_message.encoding in wide:
        dtype = np.dtype(wide[image_message.encoding])
        return rows.view(dtype.newbyteorder(">" if image_message.is_bigendian else "<"))
    channels = _CHANNELS[image_message.encoding]
    return rows if channels == 1 else rows.reshape(height, width, channels)

"""Messages as arrays: pictures as RGB, all other types as numbers."""

from __future__ import annotations

import dataclasses
import importlib
from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from joshua.messages.fields import fields
from joshua.messages.make import pixels, stamp_ns
from joshua.messages.typestore import MessageError

COMPRESSED_IMAGE = "sensor_msgs/msg/CompressedImage"

_RGB = {"rgb8": slice(None), "bgr8": slice(None, None, -1), "rgba8": slice(3), "bgra8": slice(2, None, -1)}
_NOT_SHOWN = ("header", "layout")


def array_of(message: Any, names: Sequence[str] = ()) -> Any:
    """Return the content of a message as an array.

    Args:
        message: an Image or CompressedImage gives (H, W, 3) uint8, RGB; a JointState the positions of its
            joints in radians, a LaserScan its ranges in metres, any other its numbers without headers.
        names: joints in the wanted order; () for the order of the message.

    Raises:
        MessageError: a picture has no colours or cannot be decoded, a joint is missing, or the message
            contains no number.
    """
    kind = type(message).__msgtype__
    if kind in ("sensor_msgs/msg/Image", COMPRESSED_IMAGE):
        return picture(message)
    if kind == "sensor_msgs/msg/JointState":
        return _positions(message, names)
    if kind == "sensor_msgs/msg/LaserScan":
        return np.asarray(message.ranges)
    found = [np.ravel(value) for value in _numbers(message)]
    if not found:
        raise MessageError(f"{kind} holds no number")
    return np.concatenate(found)


def picture(message: Any) -> Any:
    """Return the picture of an Image or CompressedImage, (H, W, 3) uint8, RGB, possibly a read-only view.

    Raises:
        MessageError: the picture has no colours, is damaged, or requires a decoder that is not installed.
    """
    if type(message).__msgtype__ == COMPRESSED_IMAGE:
        cv2 = load_decoder()
        decoded = cv2.imdecode(np.asarray(message.data), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
        if decoded is None:
            raise MessageError(f"a compressed image ({message.format or 'of no format'}) cannot be decoded")
        return cv2.cvtColor(decoded, cv2.COLOR_BGR2RGB)
    if message.encoding == "mono8":
        return np.repeat(pixels(message)[:, :, None], 3, axis=2)
    if message.encoding not in _RGB:
        raise MessageError(f"an image of encoding {message.encoding!r} has no colours: publish rgb8")
    return pixels(message)[:, :, _RGB[message.encoding]]


@lru_cache(maxsize=1)
def load_decoder() -> Any:
    """Import the library that decodes compressed pictures. Raises MessageError if it is not installed."""
    try:
        return importlib.import_module("cv2")
    except ImportError as error:
        raise MessageError(
            "decoding compressed images requires OpenCV: pip install opencv-python-headless"
        ) from error


def holds_numbers(type_name: str) -> bool:
    """Whether ``array_of`` supports a message type."""
    shown = [field for field in fields(type_name) if field.name not in _NOT_SHOWN]
    return any(
        holds_numbers(field.base) if field.is_message else not field.base.endswith("string")
        for field in shown
    )


def acquired_ns(message: Any, received_ns: int) -> int:
    """The stamp of a message's header, ns since the epoch; ``received_ns`` if it has none."""
    header = getattr(message, "header", None)
    return (stamp_ns(header.stamp) if header is not None else 0) or received_ns


def _positions(message: Any, names: Sequence[str]) -> Any:
    position = np.asarray(message.position, np.float64)
    if not names or list(names) == message.name:
        return position
    try:
        order = [message.name.index(name) for name in names]
        return position[order]
    except (ValueError, IndexError) as error:
        raise MessageError(
            f"a JointState has positions of {', '.join(message.name) or 'no joint'}, and {', '.join(names)} "
            "are wanted"
        ) from error


def _numbers(message: Any) -> Iterator[Any]:
    for field in dataclasses.fields(message):
        if field.name in _NOT_SHOWN:
            continue
        value = getattr(message, field.name)
        for item in value if isinstance(value, list) else (value,):
            if dataclasses.is_dataclass(item):
                yield from _numbers(item)
            elif not isinstance(item, str):
                yield item

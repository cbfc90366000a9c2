"""Fast CDR paths of ``sensor_msgs/msg/Image`` and ``CompressedImage``: writing copies once, reading never."""

from __future__ import annotations

import struct
from functools import lru_cache
from typing import Any

import numpy as np

from joshua.messages.cdr import HEADER_LE, STAMP, check_end, get_string, pad, put_string, u32, u32_at
from joshua.messages.typestore import MessageError

IMAGE = "sensor_msgs/msg/Image"
COMPRESSED_IMAGE = "sensor_msgs/msg/CompressedImage"
_STAMP = struct.Struct("<iI")
_SIZE = struct.Struct("<II")


def _bytes_of(data: Any, type_name: str) -> Any:
    """Return the data of an image as a flat buffer, from bytes or anything that holds uint8 in row order.

    Arrays of shape (H, W, C) are read in memory order, row by row.
    """
    if isinstance(data, (bytes, bytearray, memoryview)):
        return memoryview(data).cast("B") if isinstance(data, memoryview) else data
    array: Any = np.asarray(data) if not isinstance(data, np.ndarray) else data
    if array.dtype != np.uint8:
        if array.size:
            raise MessageError(f"{type_name}.data takes uint8, not {array.dtype}; view the array as uint8")
        return b""
    if not array.size:
        return b""
    # ascontiguousarray copies only strided arrays, such as a crop or a flipped image
    whole: Any = np.ascontiguousarray(array)
    return memoryview(whole).cast("B")


@lru_cache(maxsize=256)
def _image_head(
    frame_id: str, height: int, width: int, encoding: str, big_endian: int, step: int, size: int
) -> bytes:
    parts: list[bytes] = []
    at = put_string(parts, 8, frame_id)
    gap = pad(at, 4)
    parts += (gap, _SIZE.pack(height, width))
    at = put_string(parts, at + len(gap) + 8, encoding)
    parts.append(struct.pack("<B", big_endian))
    gap = pad(at + 1, 4)
    parts += (gap, _SIZE.pack(step, size))
    return b"".join(parts)


@lru_cache(maxsize=256)
def _compressed_head(frame_id: str, encoding: str) -> bytes:
    parts: list[bytes] = []
    at = put_string(parts, put_string(parts, 8, frame_id), encoding)
    parts.append(pad(at, 4))
    return b"".join(parts)


def write_image(message: Any) -> bytes:
    """Serialises an Image.

    Raises:
        MessageError: a field has the wrong type or range.
    """
    data = _bytes_of(message.data, "Image")
    header, shape = message.header, (message.height, message.width)
    try:
        head = _image_head(
            header.frame_id, *shape, message.encoding, message.is_bigendian, message.step, len(data)
        )
        stamp = STAMP.pack(HEADER_LE, header.stamp.sec, header.stamp.nanosec)
    except MessageError:
        raise
    except Exception as error:
        raise MessageError(f"Image cannot be serialised: {error}") from error
    return b"".join((stamp, head, data))


def write_compressed(message: Any) -> bytes:
    """Serialises a CompressedImage.

    Raises:
        MessageError: a field has the wrong type or range.
    """
    data = _bytes_of(message.data, "CompressedImage")
    header = message.header
    try:
        head = _compressed_head(header.frame_id, message.format)
        stamp = STAMP.pack(HEADER_LE, header.stamp.sec, header.stamp.nanosec)
    except MessageError:
        raise
    except Exception as error:
        raise MessageError(f"CompressedImage cannot be serialised: {error}") from error
    return b"".join((stamp, head, u32(len(data)), data))


class ImageReader:
    """Reads Images. ``data`` is a view of the payload, flat uint8, read-only if the payload is."""

    def __init__(self, image: Any, header: Any, time: Any) -> None:
        self._image, self._header, self._time = image, header, time

    def read(self, view: memoryview) -> Any:
        """Deserialises one little-endian message without its encapsulation header.

        Raises:
            ValueError, IndexError, struct.error: the payload is malformed.
        """
        sec, nanosec = _STAMP.unpack_from(view)
        frame_id, at = get_string(view, 8)
        at += -at % 4
        height, width = _SIZE.unpack_from(view, at)
        encoding, at = get_string(view, at + 8)
        big_endian = view[at]
        at += 1
        at += -at % 4
        step, size = _SIZE.unpack_from(view, at)
        data = _data(view, at + 8, size)
        header = self._header(self._time(sec, nanosec), frame_id)
        return self._image(header, height, width, encoding, big_endian, step, data)


class CompressedReader:
    """Reads CompressedImages. ``data`` is a view of the payload, flat uint8."""

    def __init__(self, image: Any, header: Any, time: Any) -> None:
        self._image, self._header, self._time = image, header, time

    def read(self, view: memoryview) -> Any:
        """Deserialises one little-endian message without its encapsulation header.

        Raises:
            ValueError, struct.error: the payload is malformed.
        """
        sec, nanosec = _STAMP.unpack_from(view)
        frame_id, at = get_string(view, 8)
        encoding, at = get_string(view, at)
        at += -at % 4
        size = u32_at(view, at)[0]
        data = _data(view, at + 4, size)
        return self._image(self._header(self._time(sec, nanosec), frame_id), encoding, data)


def _data(view: memoryview, at: int, size: int) -> Any:
    if at + size > len(view):
        raise ValueError(f"{size} bytes of image data do not fit into the payload")
    check_end(at + size, len(view))
    return np.frombuffer(view, np.uint8, size, at) if size else np.empty(0, np.uint8)

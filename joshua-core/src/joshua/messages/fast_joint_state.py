"""Fast CDR path of ``sensor_msgs/msg/JointState``: everything except the stamp and the numbers is cached."""

from __future__ import annotations

import struct
from functools import lru_cache
from typing import Any

import numpy as np

from joshua.messages.cdr import HEADER_LE, STAMP, check_end, get_string, pad, put_string, u32, u32_at
from joshua.messages.typestore import MessageError

TYPE_NAME = "sensor_msgs/msg/JointState"
_FLOAT64 = np.dtype("<f8")
_STAMP = struct.Struct("<iI")


@lru_cache(maxsize=256)
def _constant_parts(
    frame_id: str, names: tuple[str, ...], counts: tuple[int, int, int]
) -> tuple[bytes, bytes, bytes]:
    """The bytes before positions, velocities and efforts, with the padding that each of them needs."""
    parts: list[bytes] = []
    at = put_string(parts, 8, frame_id)
    gap = pad(at, 4)
    parts += (gap, u32(len(names)))
    at += len(gap) + 4
    for name in names:
        at = put_string(parts, at, name)
    gap = pad(at, 4)
    at += len(gap)
    parts.append(gap)
    heads = []
    for count in counts:
        at += 4
        gap = pad(at, 8) if count else b""
        heads.append(u32(count) + gap)
        at += len(gap) + 8 * count
    return b"".join(parts) + heads[0], heads[1], heads[2]


def _numbers(message: Any, field: str) -> bytes:
    value = getattr(message, field)
    try:
        array = (
            value if type(value) is np.ndarray and value.dtype == _FLOAT64 else np.asarray(value, _FLOAT64)
        )
    except (TypeError, ValueError) as error:
        raise MessageError(f"JointState.{field} takes float64 numbers: {error}") from error
    if array.ndim != 1:
        raise MessageError(f"JointState.{field} has shape {array.shape}; it takes one dimension")
    return array.tobytes()


def write(message: Any) -> bytes:
    """Serialises a JointState.

    Raises:
        MessageError: a field has the wrong type, shape or range.
    """
    header = message.header
    position = _numbers(message, "position")
    velocity = _numbers(message, "velocity")
    effort = _numbers(message, "effort")
    try:
        first, second, third = _constant_parts(
            header.frame_id,
            tuple(message.name),
            (len(position) >> 3, len(velocity) >> 3, len(effort) >> 3),
        )
        stamp = STAMP.pack(HEADER_LE, header.stamp.sec, header.stamp.nanosec)
    except MessageError:
        raise
    except Exception as error:
        raise MessageError(f"JointState cannot be serialised: {error}") from error
    return b"".join((stamp, first, position, second, velocity, third, effort))


class Reader:
    """Reads JointStates. Caches the frame and the names of the last message, which rarely change."""

    def __init__(self, joint_state: Any, header: Any, time: Any) -> None:
        self._joint_state, self._header, self._time = joint_state, header, time
        self._last: tuple[bytes, str, tuple[str, ...]] = (b"", "", ())

    def read(self, view: memoryview) -> Any:
        """Deserialises one little-endian message without its encapsulation header.

        Raises:
            ValueError, struct.error: the payload is malformed.
        """
        sec, nanosec = _STAMP.unpack_from(view)
        known, frame_id, names = self._last
        at = 8 + len(known)
        if not known or view[8:at] != known:
            frame_id, names, at = self._read_names(view)
            self._last = (bytes(view[8:at]), frame_id, names)
        at += -at % 4
        arrays = []
        for _ in range(3):
            count = u32_at(view, at)[0]
            at += 4
            if count:
                at += -at % 8
            # frombuffer rejects counts that exceed the payload
            arrays.append(np.frombuffer(view, _FLOAT64, count, at) if count else np.empty(0, _FLOAT64))
            at += 8 * count
        check_end(at, len(view))
        header = self._header(self._time(sec, nanosec), frame_id)
        return self._joint_state(header, list(names), *arrays)

    def _read_names(self, view: memoryview) -> tuple[str, tuple[str, ...], int]:
        frame_id, at = get_string(view, 8)
        at += -at % 4
        count = u32_at(view, at)[0]
        at += 4
        if at + 5 * count > len(view):
            raise ValueError(f"{count} joint names do not fit into the payload")
        names = []
        for _ in range(count):
            name, at = get_string(view, at)
            names.append(name)
        return frame_id, tuple(names), at

"""Messages to CDR bytes and back: fast paths where they pay, ``rosbags`` for everything else."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

from joshua.messages.cdr import NATIVE_LE
from joshua.messages.errors import MessageError
from joshua.messages.typestore import distro, message_class, require_type, type_hash, typestore

_Writer = Callable[[Any], Any]
_Reader = Callable[[memoryview], Any]
_LITTLE = 1


class _Codecs:
    """The codecs of one distribution."""

    def __init__(self, name: str) -> None:
        from rosbags.serde import SerdeError

        from joshua.messages import fast_image, fast_joint_state
        from joshua.messages.fields import arrays_fit, build

        self.distro = name
        self.store = typestore()
        self.arrays_fit, self.build = arrays_fit, build
        self.malformed = (SerdeError, ValueError, IndexError, struct.error, OverflowError, AssertionError)
        self.writers: dict[type, _Writer] = {}
        self.readers: dict[str, _Reader] = {}
        if not NATIVE_LE:
            return
        header, time = message_class("std_msgs/msg/Header"), message_class("builtin_interfaces/msg/Time")
        joint_state = message_class(fast_joint_state.TYPE_NAME)
        image, compressed = message_class(fast_image.IMAGE), message_class(fast_image.COMPRESSED_IMAGE)
        self.writers = {
            joint_state: fast_joint_state.write,
            image: fast_image.write_image,
            compressed: fast_image.write_compressed,
        }
        self.readers = {
            fast_joint_state.TYPE_NAME: fast_joint_state.Reader(joint_state, header, time).read,
            fast_image.IMAGE: fast_image.ImageReader(image, header, time).read,
            fast_image.COMPRESSED_IMAGE: fast_image.CompressedReader(compressed, header, time).read,
        }

    def encode(self, message: Any) -> Any:
        writer = self.writers.get(type(message))
        if writer is not None:
            return writer(message)
        name = getattr(message, "__msgtype__", None)
        if not isinstance(name, str):
            raise MessageError(
                f"{type(message).__name__} is not a ROS 2 message; make one with "
                "joshua.messages.message_class"
            )
        if self.store.types.get(name) is not type(message):
            raise MessageError(f"this {name} does not belong to the message classes of ROS 2 {self.distro}")
        try:
            if self.arrays_fit(message, name):
                return self.store.serialize_cdr(message, name)
        except Exception as error:  # noqa: BLE001 - whatever the generated code stumbled over
            # building anew names the field that does not fit, and turns lists into arrays
            return self._encode_checked(message, name, error)
        return self._encode_checked(message, name, None)

    def _encode_checked(self, message: Any, name: str, cause: Exception | None) -> Any:
        checked = self.build(name, message)
        try:
            return self.store.serialize_cdr(checked, name)
        except Exception as error:
            raise MessageError(f"{name} cannot be serialised: {cause or error}") from error

    def decode(self, type_name: str, cdr: Any) -> Any:
        view = cdr if type(cdr) is memoryview else memoryview(cdr)
        reader = self.readers.get(type_name)
        try:
            if reader is not None and view[0] == 0 and view[1] == _LITTLE:
                return reader(view[4:])
            return self.store.deserialize_cdr(view, require_type(type_name))
        except MessageError:
            raise
        except self.malformed as error:
            raise MessageError(f"a payload of {len(view)} bytes is no {type_name}: {error}") from error


_codecs: _Codecs | None = None


def _current() -> _Codecs:
    global _codecs
    if _codecs is None or _codecs.distro != distro():
        _codecs = _Codecs(distro())
    return _codecs


def encode(message: Any) -> Any:
    """Serialises a message to little-endian CDR with its encapsulation header.

    Args:
        message: object of a class that ``message_class`` returned; lists serve for arrays.

    Returns:
        bytes or a read-only memoryview.

    Raises:
        MessageError: not a message, or a field has the wrong type, shape or range.
    """
    return _current().encode(message)


def decode(type_name: str, cdr: Any) -> Any:
    """Deserialises CDR bytes of either byte order; numeric arrays are views where the order is ours.

    Args:
        type_name: ROS 2 type, such as ``sensor_msgs/msg/Image``.
        cdr: bytes-like payload with its encapsulation header.

    Raises:
        MessageError: the type is unknown or the payload malformed.
    """
    return _current().decode(type_name, cdr)


def preload(type_names: tuple[str, ...] = ()) -> None:
    """Loads the definitions and compiles the codecs of the named types, those with a fast path excepted.

    A fork server calls it once, so that its children find everything in memory; a node before it is active,
    because compiling takes longer than a control loop may stand.

    Raises:
        MessageError: a type is unknown.
    """
    codecs = _current()
    for name in type_names:
        if name not in codecs.readers:
            codecs.store.get_msgdef(require_type(name))
        type_hash(name)

"""Messages to CDR bytes and back: fast paths where they pay off, ``rosbags`` for everything else."""

from __future__ import annotations

import struct
from typing import Any

from joshua.messages.cdr import NATIVE_LE
from joshua.messages.typestore import MessageError, distro, message_class, require_type, type_hash, typestore

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
        self.writers: dict[type, Any] = {}
        self.readers: dict[str, Any] = {}
        if not NATIVE_LE:
            return
        header, time = message_class("std_msgs/msg/Header"), message_class("builtin_interfaces/msg/Time")
        for kind, write, reader in (
            (fast_joint_state.TYPE_NAME, fast_joint_state.write, fast_joint_state.Reader),
            (fast_image.IMAGE, fast_image.write_image, fast_image.ImageReader),
            (fast_image.COMPRESSED_IMAGE, fast_image.write_compressed, fast_image.CompressedReader),
        ):
            made: Any = reader
            self.writers[message_class(kind)] = write
            self.readers[kind] = made(message_class(kind), header, time).read


_codecs: _Codecs | None = None


def _current() -> _Codecs:
    global _codecs
    if _codecs is None or _codecs.distro != distro():
        _codecs = _Codecs(distro())
    return _codecs


def encode(message: Any) -> Any:
    """Serialise a message to little-endian CDR with its encapsulation header.

    Args:
        message: object of a class that ``message_class`` returned. Lists are accepted for arrays.

    Returns:
        bytes or a read-only memoryview.

    Raises:
        MessageError: not a message, or a field has the wrong type, shape or range.
    """
    codecs = _current()
    writer = codecs.writers.get(type(message))
    if writer is not None:
        return writer(message)
    name = getattr(message, "__msgtype__", None)
    if not isinstance(name, str):
        raise MessageError(
            f"{type(message).__name__} is not a ROS 2 message; make one with joshua.messages.message_class"
        )
    if codecs.store.types.get(name) is not type(message):
        raise MessageError(f"this {name} does not belong to the message classes of ROS 2 {codecs.distro}")
    cause: Exception | None = None
    try:
        if codecs.arrays_fit(message, name):
            return codecs.store.serialize_cdr(message, name)
    except Exception as error:  # noqa: BLE001 - whatever the generated code stumbled over
        cause = error
    # building it again names the invalid field and turns lists into arrays
    checked = codecs.build(name, message)
    try:
        return codecs.store.serialize_cdr(checked, name)
    except Exception as error:
        raise MessageError(f"{name} cannot be serialised: {cause or error}") from error


def decode(type_name: str, cdr: Any) -> Any:
    """Deserialise CDR bytes of either byte order. Numeric arrays are views if the order is native.

    Args:
        type_name: ROS 2 type, such as ``sensor_msgs/msg/Image``.
        cdr: bytes-like payload with its encapsulation header.

    Raises:
        MessageError: the type is unknown or the payload is malformed.
    """
    codecs = _current()
    view = cdr if type(cdr) is memoryview else memoryview(cdr)
    reader = codecs.readers.get(type_name)
    try:
        if reader is not None and view[0] == 0 and view[1] == _LITTLE:
            return reader(view[4:])
        return codecs.store.deserialize_cdr(view, require_type(type_name))
    except MessageError:
        raise
    except codecs.malformed as error:
        raise MessageError(f"a payload of {len(view)} bytes is no {type_name}: {error}") from error


def preload(type_names: tuple[str, ...] = ()) -> None:
    """Load the definitions and compile the codecs of the named types, except those with a fast path.

    The fork server calls it once, and its children share the result. A node calls it before it is active,
    because compiling takes longer than a control loop may stall.

    Raises:
        MessageError: a type is unknown.
    """
    codecs = _current()
    for name in type_names:
        if name not in codecs.readers:
            codecs.store.get_msgdef(require_type(name))
            message_class(name)
        type_hash(name)

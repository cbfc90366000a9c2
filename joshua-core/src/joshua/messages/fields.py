"""Fields of a message as data: build a message from plain values, check it, convert it back."""

from __future__ import annotations

import difflib
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any

import numpy as np

from joshua.messages.typestore import MessageError, definitions, distro, message_class, require_type

PLACEHOLDER = "structure_needs_at_least_one_member"
"""The member that a message without fields has on the wire."""

_TIME = "builtin_interfaces/msg/Time"
_HEADER = "std_msgs/msg/Header"
_DTYPES: dict[str, Any] = {
    "bool": np.bool_,
    "byte": np.uint8,
    "char": np.uint8,
    **{name: np.dtype(name) for name in ("int8", "uint8", "int16", "uint16", "int32", "uint32")},
    **{name: np.dtype(name) for name in ("int64", "uint64", "float32", "float64")},
}
_LARGEST_FLOAT32 = float(np.finfo(np.float32).max)


@dataclass(frozen=True)
class Field:
    """One field of a message type.

    Attributes:
        name: attribute of the class; wire_name: name in the ROS 2 definition.
        base: primitive such as ``float64`` or ``string``, or the full name of a message type.
        is_message: whether ``base`` is a message type.
        shape: ``one``, ``array`` (fixed length) or ``sequence``.
        length: fixed length of an array, upper bound of a sequence; 0 for none.
    """

    name: str
    wire_name: str
    base: str
    is_message: bool
    shape: str
    length: int

    @property
    def text(self) -> str:
        """The type as in a ROS 2 definition, such as ``float64[6]``."""
        base = self.base.replace("/msg/", "/")
        if self.shape == "one":
            return base
        bound = f"<={self.length}" if self.shape == "sequence" and self.length else self.length or ""
        return f"{base}[{bound}]"


def fields(type_name: str) -> tuple[Field, ...]:
    """The fields of a message type in wire order.

    Raises:
        MessageError: the type is unknown.
    """
    return _fields(require_type(type_name), distro())


@lru_cache(maxsize=512)
def _fields(full_name: str, _distro: str) -> tuple[Field, ...]:
    from rosbags.interfaces import Nodetype
    from rosbags.typesys.base import normalize_fieldname

    shapes = {Nodetype.ARRAY: "array", Nodetype.SEQUENCE: "sequence"}
    result = []
    desc: Any
    for wire_name, desc in definitions().fielddefs[full_name][1]:
        shape, length = "one", 0
        inner: Any = desc
        if desc[0] in shapes:
            shape = shapes[desc[0]]
            inner, length = desc[1]
        is_message = inner[0] == Nodetype.NAME
        base = str(inner[1] if is_message else inner[1][0])
        result.append(Field(normalize_fieldname(wire_name), wire_name, base, is_message, shape, int(length)))
    return tuple(result)


def give_defaults(cls: Any, full_name: str) -> None:
    """Let the constructor of a message class take fields by position or name, and None for zero.

    With Humble's definitions, fields that only Jazzy has are accepted and ignored.
    """
    known = fields(full_name)
    later = definitions(humble=False).fielddefs.get(full_name, ((), ()))[1]
    names = [field.name for field in known]
    ignored = [name for name, _ in later if name not in {field.wire_name for field in known}]
    lines = [f"def __init__(self, {', '.join(f'{name}=None' for name in [*names, *ignored])}):"]
    lines += [
        f" self.{name} = zeros[{index}]() if {name} is None else {name}" for index, name in enumerate(names)
    ]
    scope: dict[str, Any] = {"zeros": [partial(_zero, field) for field in known]}
    exec("\n".join(lines), scope)  # noqa: S102 - as dataclasses do; the names are those of the definitions
    cls.__init__ = scope["__init__"]


def build(type_name: str, values: Any = None, path: str = "") -> Any:
    """Make a message from plain values. Missing fields get the zero of their type.

    Args:
        type_name: ROS 2 type.
        values: mapping of field names to numbers, texts, lists and mappings. A time also takes the text
            ``now``, a header also ``auto``. An object of the message class is checked.
        path: location of the values, for error messages.

    Raises:
        MessageError: a field is unknown (the message lists the nearest names) or a value has the wrong type.
    """
    full = require_type(type_name)
    known = fields(full)
    if full == _TIME and values == "now":
        values = dict(zip(("sec", "nanosec"), divmod(time.time_ns(), 1_000_000_000), strict=True))
    if full == _HEADER and values == "auto":
        values = {"stamp": "now"}
    if values is None:
        values = {}
    if isinstance(values, message_class(full)):
        values = {field.name: getattr(values, field.name) for field in known}
    if not isinstance(values, Mapping):
        raise _misfit(path or full, values, f"a mapping of the fields of {full}")
    by_name = {name: field for field in known for name in (field.name, field.wire_name)}
    for name in values:
        if name not in by_name:
            raise _unknown_field(path, full, str(name), known)
    chosen = {by_name[name].name: value for name, value in values.items()}
    made = {
        field.name: _value(field, chosen[field.name], f"{path}.{field.wire_name}".lstrip("."))
        for field in known
        if field.name in chosen
    }
    return message_class(full)(**made)


def to_plain(message: Any) -> dict[str, Any]:
    """Convert a message to nested mappings. Arrays stay arrays, and octets range from 0 to 255."""
    result: dict[str, Any] = {}
    for field in fields(message.__msgtype__):
        if field.wire_name == PLACEHOLDER:
            continue
        value = getattr(message, field.name)
        if field.is_message:
            value = to_plain(value) if field.shape == "one" else [to_plain(item) for item in value]
        result[field.wire_name] = value
    return result


def arrays_fit(message: Any, type_name: str) -> bool:
    """Whether every numeric array of a message has the element type of its field.

    The encoder copies the bytes of an array: int64 numbers in a float64 field would arrive as other numbers.
    """
    for field in _array_paths(type_name, distro()):
        value = getattr(message, field.name)
        if not field.is_message:
            if getattr(value, "dtype", None) != _DTYPES[field.base]:
                return False
        elif field.shape == "one":
            if not arrays_fit(value, field.base):
                return False
        elif not all(arrays_fit(item, field.base) for item in value):
            return False
    return True


@lru_cache(maxsize=512)
def _array_paths(full_name: str, name: str) -> tuple[Field, ...]:
    return tuple(
        field
        for field in _fields(full_name, name)
        if (
            _array_paths(field.base, name)
            if field.is_message
            else field.shape != "one" and field.base in _DTYPES
        )
    )


def _zero(field: Field) -> Any:
    count = field.length if field.shape == "array" else 0
    if field.shape != "one":
        if field.base in _DTYPES:
            return np.zeros(count, _DTYPES[field.base])
        return [message_class(field.base)() if field.is_message else "" for _ in range(count)]
    if field.is_message:
        return message_class(field.base)()
    if field.base == "string":
        return ""
    return False if field.base == "bool" else 0.0 if field.base.startswith("float") else 0


def _value(field: Field, value: Any, path: str) -> Any:
    if field.shape == "one":
        return _one(field, value, path)
    if isinstance(value, (bytes, bytearray)) and field.base in ("uint8", "byte", "char"):
        value = np.frombuffer(value, _DTYPES[field.base])
    if isinstance(value, str) or not isinstance(value, (Sequence, np.ndarray)):
        raise _misfit(path, value, f"a list for {field.text}")
    items = (
        _array(field, value, path)
        if field.base in _DTYPES
        else [_one(field, item, f"{path}[{index}]") for index, item in enumerate(value)]
    )
    if field.shape == "array" and len(items) != field.length:
        raise _misfit(path, f"{len(items)} values", f"exactly {field.length} values ({field.text})")
    if field.length and len(items) > field.length:
        raise _misfit(path, f"{len(items)} values", f"at most {field.length} values ({field.text})")
    return items


def _array(field: Field, value: Any, path: str) -> Any:
    dtype = np.dtype(_DTYPES[field.base])
    if isinstance(value, np.ndarray):
        if value.ndim != 1:
            raise _misfit(path, f"shape {value.shape}", f"one dimension ({field.text})")
        if np.can_cast(value.dtype, dtype, "safe") or (value.dtype.kind in "iuf" and dtype.kind == "f"):
            return np.ascontiguousarray(value, dtype)
    return np.array([_one(field, item, f"{path}[{index}]") for index, item in enumerate(value)], dtype)


def _one(field: Field, value: Any, path: str) -> Any:
    if field.is_message:
        return build(field.base, value, path)
    if field.base == "string":
        if not isinstance(value, str):
            raise _misfit(path, value, "a text")
        return value
    if field.base == "bool":
        if not isinstance(value, (bool, np.bool_)):
            raise _misfit(path, value, "true or false")
        return bool(value)
    if isinstance(value, (bool, np.bool_)):
        raise _misfit(path, value, f"a number ({field.base})")
    if field.base.startswith("float"):
        if not isinstance(value, (int, float, np.integer, np.floating)):
            raise _misfit(path, value, f"a number ({field.base})")
        number = float(value)
        if field.base == "float32" and math.isfinite(number) and abs(number) > _LARGEST_FLOAT32:
            raise _misfit(path, value, "a number within the range of float32")
        return number
    limits = np.iinfo(_DTYPES[field.base])
    if not isinstance(value, (int, np.integer)) or not limits.min <= int(value) <= limits.max:
        raise _misfit(path, value, f"a whole number from {limits.min} to {limits.max} ({field.base})")
    return int(value)


def _misfit(path: str, found: Any, allowed: str) -> MessageError:
    text = repr(found) if not isinstance(found, (Mapping, Sequence)) or isinstance(found, str) else str(found)
    return MessageError(f"{path}: found {text[:80]}; it takes {allowed}")


def _unknown_field(path: str, full: str, name: str, known: tuple[Field, ...]) -> MessageError:
    names = [field.wire_name for field in known if field.wire_name != PLACEHOLDER]
    near = difflib.get_close_matches(name, names, n=1, cutoff=0.5)
    ordered = near + [other for other in names if other not in near]
    where = f"{path}: " if path else ""
    listing = f"it has {', '.join(ordered)}" if ordered else "it has no fields"
    hint = f"; did you mean {near[0]}?" if near else ""
    return MessageError(f"{where}{full} has no field {name!r}; {listing}{hint}")

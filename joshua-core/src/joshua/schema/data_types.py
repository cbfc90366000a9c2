"""The DataType enum and the ROS 2 type names of its values."""

from __future__ import annotations

from joshua.schema.data_type_names import TYPE_NAMES
from joshua.schema.data_type_pb2 import DataType

_type_names = tuple(TYPE_NAMES[key] for key in sorted(TYPE_NAMES))
_numbers_by_type_name = {name: number for number, name in TYPE_NAMES.items()}


def type_name(number: int) -> str:
    """Returns the ROS 2 type of a DataType value, such as ``sensor_msgs/msg/JointState``.

    Raises:
        ValueError: if the number is no DataType, or is DATA_TYPE_UNSPECIFIED.
    """
    try:
        return TYPE_NAMES[number]
    except KeyError:
        raise ValueError(f"{number} is not the number of a ROS 2 type in the DataType enum") from None


def number(name: str) -> int:
    """Returns the DataType value of a ROS 2 type (``sensor_msgs/msg/Image``) or an enum name (``IMAGE``).

    Raises:
        ValueError: if the DataType enum has no such type or name.
    """
    found = _numbers_by_type_name.get(name)
    if found is not None:
        return found
    value = DataType.DESCRIPTOR.values_by_name.get(name) if name.isascii() else None
    if value is None or value.number == 0:
        raise ValueError(f"the DataType enum has no type {name!r}; write it as package/msg/Type or IMAGE")
    return int(value.number)


def enum_names(number: int) -> tuple[str, ...]:
    """Returns the names of a DataType value: the main one first, then other spellings.

    Raises:
        ValueError: if the number is no DataType.
    """
    names = tuple(value.name for value in DataType.DESCRIPTOR.values if value.number == number)
    if not names:
        raise ValueError(f"{number} is not a number of the DataType enum")
    return names


def type_names() -> tuple[str, ...]:
    """Returns all ROS 2 types of the enum, by rising number."""
    return _type_names

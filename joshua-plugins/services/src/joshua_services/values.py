"""Conversion between values and ROS 2 parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from joshua.messages import message_class

_VALUE = "rcl_interfaces/msg/ParameterValue"
# rcl_interfaces/msg/ParameterType, with the field of a ParameterValue; bool before int, its base class
_TYPES: tuple[tuple[type, int, str], ...] = (
    (bool, 1, "bool_value"),
    (int, 2, "integer_value"),
    (float, 3, "double_value"),
    (str, 4, "string_value"),
)
_ARRAY_TYPES = {1: (6, "bool_array_value"), 2: (7, "integer_array_value"), 3: (8, "double_array_value")}
_ARRAY_TYPES[4] = (9, "string_array_value")
_FIELDS = {5: "byte_array_value", **dict(_ARRAY_TYPES.values())}
_FIELDS |= {number: field for _, number, field in _TYPES}


def flat(settings: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Convert settings to parameters: names with dots, values that ROS 2 has a type for."""
    found: dict[str, Any] = {}
    for key, value in settings.items():
        if isinstance(value, Mapping):
            found |= flat(value, f"{prefix}{key}.")
        elif type_of(value)[0]:
            found[f"{prefix}{key}"] = value
    return found


def nested(values: Mapping[str, Any]) -> dict[str, Any]:
    """Invert ``flat``."""
    found: dict[str, Any] = {}
    for name, value in values.items():
        *folders, last = name.split(".")
        place = found
        for folder in folders:
            inner = place.setdefault(folder, {})
            place = inner if isinstance(inner, dict) else {}
        place[last] = value
    return found


def type_of(value: Any) -> tuple[int, str]:
    """Return ParameterType and field of a value; 0 for one that parameters cannot hold."""
    for kind, number, field in _TYPES:
        if isinstance(value, kind):
            return number, field
    if isinstance(value, (list, tuple)) and value:
        numbers = {type_of(item)[0] for item in value}
        if numbers == {2, 3}:
            numbers = {3}
        return _ARRAY_TYPES.get(numbers.pop(), (0, "")) if len(numbers) == 1 else (0, "")
    return 0, ""


def parameter_value(value: Any) -> Any:
    """Return a ParameterValue; one without a type for None."""
    number, field = type_of(value)
    return message_class(_VALUE)(**({"type": number, field: value} if number else {}))


def value_of(message: Any) -> Any:
    """Return the value of a ParameterValue; None for one without a type."""
    field = _FIELDS.get(int(message.type))
    value = None if field is None else getattr(message, field)
    return value if value is None or not hasattr(value, "tolist") else value.tolist()

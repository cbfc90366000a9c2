"""Facts of protobuf descriptors that differ between the versions of the runtime."""

from __future__ import annotations

from typing import Any


def is_repeated(field: Any) -> bool:
    """Return whether a field is a list or a map.

    Args:
        field: a FieldDescriptor. Before protobuf 6.31 it has only ``label``, from 7.36 on only
            ``is_repeated``.
    """
    known = getattr(field, "is_repeated", None)
    if known is None:
        known = field.label == field.LABEL_REPEATED
    return bool(known)

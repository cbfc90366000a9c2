"""The comments of a proto file, which the documentation of every option is taken from.

Compiling a proto drops its comments, so they are kept in a JSON table beside the compiled module:
``config_pb2.comments.json`` beside ``config_pb2.py``. Keys are full names; an enum value is named with
its enum, as in ``joshua.OperationMode.MODE_TEST``; the key "" holds the comment at the head of the file.
"""

from __future__ import annotations

import json
import sys
from functools import cache
from pathlib import Path
from typing import Any

SUFFIX = ".comments.json"


def comment(descriptor: Any) -> str:
    """Returns the comment of a message, field, oneof, enum or enum value descriptor; "" for none."""
    table = _table_of(descriptor)
    enum = getattr(descriptor, "type", None)
    if enum is not None and hasattr(enum, "values_by_name"):
        return table.get(f"{enum.full_name}.{descriptor.name}", "")
    return table.get(descriptor.full_name, "")


def _table_of(descriptor: Any) -> dict[str, str]:
    owner = descriptor
    while getattr(owner, "file", None) is None:
        # An enum value knows its enum, a field or oneof its message.
        owner = getattr(owner, "containing_type", None) or owner.type
    return _load(owner.file.name)


@cache
def _load(proto_name: str) -> dict[str, str]:
    """Finds the compiled module of a proto file among those that are imported, and the table beside it."""
    for name, module in list(sys.modules.items()):
        if not name.endswith("_pb2"):
            continue
        descriptor = getattr(module, "DESCRIPTOR", None)
        if getattr(descriptor, "name", None) == proto_name and getattr(module, "__file__", None):
            path = Path(str(module.__file__)).with_suffix(SUFFIX)
            if path.is_file():
                table: dict[str, str] = json.loads(path.read_text(encoding="utf-8"))
                return table
    return {}

"""The comments of a proto file, from which the documentation of every option is made.

Compiling a proto drops its comments, so a JSON table beside the compiled module contains them:
``config_pb2.comments.json`` beside ``config_pb2.py``. Keys are full names. The key of an enum value includes
its enum, as in ``joshua.OperationMode.MODE_TEST``. The key "" has the comment at the head of the file.
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
        # An enum value refers to its enum, a field or oneof to its message.
        owner = getattr(owner, "containing_type", None) or owner.type
    return _load(owner.file.name)


@cache
def _load(proto_name: str) -> dict[str, str]:
    """Find the compiled module of a proto file among the imported ones, and load its table."""
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

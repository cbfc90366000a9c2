"""The DataType page: which value stands for which ROS 2 message type."""

from __future__ import annotations

from collections import defaultdict

from joshua.schema import data_type_pb2
from joshua.schema.data_types import type_name

from reference.markdown import code, table

HEAD = """# Message types

The values of `data_type` in publishers and subscriptions, and the ROS 2 message type that each stands for.
"""


def data_types_page() -> str:
    """Makes the page, one table for each ROS 2 package."""
    packages: dict[str, list[tuple[str, str, str]]] = defaultdict(list)
    for value in data_type_pb2.DataType.DESCRIPTOR.values:
        if value.number:
            name = type_name(value.number)
            packages[name.partition("/")[0]].append((code(value.name), code(name), str(value.number)))
    lines = [HEAD]
    for package, rows in sorted(packages.items()):
        lines += [f"## {package}", "", *table(("data_type", "ROS 2 type", "Number"), rows)]
    return "\n".join(lines)

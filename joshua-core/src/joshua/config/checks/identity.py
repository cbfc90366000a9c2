"""Checks that node ids and names are unique, and that process groups are possible."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from joshua.config.checks.context import Context
from joshua.config.checks.device_table import device_block
from joshua.plan import Diagnostic
from joshua.plan.graph import NodeEntry


def check(context: Context) -> Iterator[Diagnostic]:
    """Find duplicate ids and names, and process groups whose nodes cannot share a process."""
    yield from _ids(context)
    yield from _names(context)
    yield from _arms(context)
    yield from _process_groups(context)


def title(entry: NodeEntry) -> str:
    """Name of a node in messages: its name, else the path of its entry."""
    return entry.node.node_name or entry.owner_path


def free_ids(context: Context) -> dict[str, int]:
    """Return an unused node_id for each node without a unique one, by the path of the node."""
    owners: dict[int, str] = {}
    for entry in context.graph.entries:
        if context.is_known(f"{entry.path}.node_id", entry.node.node_id):
            owners.setdefault(entry.node.node_id, entry.path)
    lacking = [entry.path for entry in context.graph.entries if owners.get(entry.node.node_id) != entry.path]
    unused = (number for number in itertools.count(1) if number not in owners)
    return dict(zip(lacking, unused, strict=False))


def _ids(context: Context) -> Iterator[Diagnostic]:
    free = free_ids(context)
    first: dict[int, NodeEntry] = {}
    for entry in context.graph.entries:
        path = f"{entry.path}.node_id"
        if not context.is_known(path, entry.node.node_id):
            continue
        other = first.setdefault(entry.node.node_id, entry)
        if other is not entry:
            yield context.error(
                "duplicate-node-id",
                f"{title(entry)} and {title(other)} have the same node_id; each node needs its own",
                path,
                allowed=(f"{free[entry.path]} (a free id)",),
                related=context.see(f"{other.path}.node_id", f"{title(other)} has this id"),
            )


def _names(context: Context) -> Iterator[Diagnostic]:
    taken = {entry.full_name for entry in context.graph.entries}
    first: dict[str, NodeEntry] = {}
    for entry in context.graph.entries:
        if not entry.node.node_name:
            continue
        other = first.setdefault(entry.full_name, entry)
        if other is not entry:
            path = f"{entry.path}.node_name"
            suggestion = next(
                name
                for number in range(2, len(context.graph.entries) + 3)
                if f"{entry.namespace.rstrip('/')}/{(name := f'{entry.node.node_name}_{number}')}"
                not in taken
            )
            yield context.error(
                "duplicate-node-name",
                f"Two nodes are called {entry.full_name}; names are unique in a ROS 2 graph",
                path,
                allowed=(f'"{suggestion}"', "the same name in another ros_namespace"),
                related=context.see(f"{other.path}.node_name", "first node of this name"),
            )


def _arms(context: Context) -> Iterator[Diagnostic]:
    """A calibration identifies its actuator by node_name alone, without the namespace."""
    first: dict[tuple[str, str], NodeEntry] = {}
    for entry in context.graph.entries:
        name = entry.node.node_name
        if not entry.is_actuator or not name:
            continue
        block, _, rule = device_block(entry.owner)
        if not block or rule.virtual:
            continue
        other = first.setdefault((name, entry.node.host), entry)
        if other is entry or other.full_name == entry.full_name:
            continue  # equal full names are reported elsewhere
        path = f"{entry.path}.node_name"
        yield context.error(
            "actuator-name-shared",
            f"{entry.full_name} and {other.full_name} have one node_name, but a calibration identifies its "
            "actuator by this name, so both would use the same one",
            path,
            allowed=(f'"{entry.namespace.strip("/").replace("/", "_") or "other"}_{name}"',),
            related=context.see(f"{other.path}.node_name", "first actuator of this name"),
        )


def _process_groups(context: Context) -> Iterator[Diagnostic]:
    first: dict[str, NodeEntry] = {}
    for entry in context.graph.entries:
        group = entry.node.process_group
        if not group:
            continue
        other = first.setdefault(group, entry)
        for field, what in (("python", "interpreters"), ("host", "machines")):
            mine, theirs = getattr(entry.node, field), getattr(other.node, field)
            if mine == theirs:
                continue
            path = f"{entry.path}.{field}" if mine else f"{entry.path}.process_group"
            yield context.error(
                "process-group-split",
                f"{title(entry)} and {title(other)} share the process group {group}, "
                f"so they cannot run with different {what}",
                path,
                found=f'{field}: "{mine}" here, "{theirs}" in {title(other)}',
                remedy=f"Give both the same {field}, or put one of them into another process_group",
                related=context.see(
                    f"{other.path}.{field}" if theirs else f"{other.path}.process_group", title(other)
                ),
            )

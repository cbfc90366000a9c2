"""Which nodes share a process."""

from __future__ import annotations

from collections.abc import Sequence

from joshua.plan import NodeSpec


def process_groups(nodes: Sequence[NodeSpec]) -> list[tuple[NodeSpec, ...]]:
    """Splits nodes into processes, in start order; a group starts where its first node stands."""
    groups: dict[tuple[str, str], list[NodeSpec]] = {}
    for spec in nodes:
        key = ("group", spec.process_group) if spec.process_group else ("node", spec.full_name)
        groups.setdefault(key, []).append(spec)
    return [tuple(specs) for specs in groups.values()]

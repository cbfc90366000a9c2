"""Which node of a running system holds a port."""

from __future__ import annotations

from collections.abc import Iterable


def node_that_holds(processes: Iterable[int]) -> str:
    """Says which node of a running system is among some processes, and what to do; "" where none is."""
    wanted = set(processes)
    if not wanted:
        return ""
    from joshua.ipc.client import CallError, RunningSystem

    for system in RunningSystem.all():
        try:
            nodes = system.status().nodes
        except CallError:
            continue  # it ends just now, or does not answer; the process is named all the same
        info = system.info
        for node in nodes:
            if node.process_id in wanted:
                return (
                    f"in use by {node.full_name} of {info.source}, which runs now: "
                    f"`joshua stop` ends it (process {info.process_id})"
                )
    return ""

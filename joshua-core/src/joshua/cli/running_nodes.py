"""Which node of a running system holds a port."""

from __future__ import annotations

import os
from collections.abc import Iterable


def node_that_holds(processes: Iterable[int]) -> str:
    """Says which node of a running system is among some processes, and what to do; "" where none is."""
    wanted = set(processes)
    if not wanted:
        return ""
    from joshua.supervisor.control_server import ask
    from joshua.supervisor.run_directory import SOCKET_NAME, user_systems

    for path, info in user_systems(os.environ):
        try:
            nodes = ask(path / SOCKET_NAME, {"request": "status"})["status"]["nodes"]
        except (OSError, ValueError, KeyError):
            continue  # it ends just now, or does not answer; the process is named all the same
        for node in nodes:
            if node["process_id"] in wanted:
                return (
                    f"in use by {node['full_name']} of {info.source}, which runs now: "
                    f"`joshua stop` ends it (process {info.process_id})"
                )
    return ""

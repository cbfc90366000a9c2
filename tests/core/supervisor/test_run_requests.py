"""Requests on the control socket that wait for a node."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from joshua.plan import NodeKind
from joshua.supervisor.control_server import Deferred
from joshua.supervisor.run_requests import RunRequests

ARM = "/arm"


class Process:
    """An actuator's process that starts again just now."""

    alive, ready, restart_timer = True, False, None

    def __init__(self) -> None:
        self.records = {ARM: SimpleNamespace(spec=SimpleNamespace(kind=NodeKind.ACTUATOR), reason="")}
        self.resumed: list[str] = []

    def resume(self, node: str) -> None:
        self.resumed.append(node)


@pytest.mark.parametrize(("waits", "resumed"), [([True], [ARM]), ([False], []), ([False, True], [ARM])])
def test_a_node_gets_torque_only_if_somebody_still_waits_for_it(
    waits: list[bool], resumed: list[str]
) -> None:
    process = Process()
    run: Any = SimpleNamespace(
        status=lambda: SimpleNamespace(phase="running"), process_of=lambda node: process, revive=None
    )
    requests = RunRequests(run, SimpleNamespace(write=lambda *_: None))  # type: ignore[arg-type]
    resume = requests.handlers()["resume"]
    for still_waits in waits:
        deferred = resume({"request": "resume", "node": ARM})
        assert isinstance(deferred, Deferred)
        deferred.abandoned = not still_waits
    requests.ready(process)  # type: ignore[arg-type]
    assert process.resumed == resumed
    again = resume({"request": "resume", "node": ARM})  # nothing is left of those that have gone
    assert isinstance(again, Deferred)

"""The end of a node, whatever its behaviour does on the way."""

from __future__ import annotations

import logging
import sys
import threading
import types
from typing import Any

import pytest
from joshua.ipc.messages import Report
from joshua.node.behaviour import NodeBehaviour
from joshua.node.logs import NodeLogHandler
from joshua.node.runtime import NodeRuntime, RuntimeServices
from joshua.plan import NodeKind, NodeSpec


class Behaviour(NodeBehaviour):
    """Stops at once, and cannot say how its joints moved."""

    steps: list[str]

    def configure(self) -> None:
        self.steps.append("configure")

    def activate(self) -> None:
        raise RuntimeError("a fault of the driver")

    def deactivate(self) -> None:
        self.steps.append("deactivate")

    def cleanup(self) -> None:
        self.steps.append("cleanup")

    def test_results(self) -> list[tuple[str, bool, str]]:
        return [("a check", True, "good")]

    def test_traces(self) -> list[Any]:
        raise ZeroDivisionError("no cycle was recorded")


def test_a_device_is_closed_also_where_the_results_of_a_test_cannot_be_had(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    module = types.ModuleType("joshua_behaviour_of_a_test")
    module.Behaviour = type("Behaviour", (Behaviour,), {"steps": []})  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, module.__name__, module)
    endpoint = types.SimpleNamespace(publish=lambda cdr: None, close=lambda: None)
    node = types.SimpleNamespace(create_publisher=lambda *_, **__: endpoint, close=lambda: None)
    transport = types.SimpleNamespace(carries_services=True, create_node=lambda *_: node)
    monkeypatch.setattr("joshua.node.runtime.extend", lambda node: module.Behaviour.steps.append("extend"))
    sent: list[Any] = []
    activation = threading.Event()
    activation.set()
    services = RuntimeServices(
        send=sent.append,
        transport=lambda: transport,  # type: ignore[arg-type, return-value]
        activation=activation,
        logs=NodeLogHandler(sent.append, "/arm"),
        log_level=logging.INFO,
        heartbeat_s=0.05,
    )
    spec = NodeSpec(
        name="arm", kind=NodeKind.SENSOR, behaviour=f"{module.__name__}:Behaviour", implementation=""
    )
    NodeRuntime(spec, services).run()
    assert module.Behaviour.steps == ["configure", "extend", "deactivate", "cleanup"]
    (report,) = [message.report for message in sent if isinstance(message, Report)]
    assert report.reason == "RuntimeError: a fault of the driver"
    assert [(row.check, row.passed) for row in report.checks] == [("test results", False)]
    assert report.checks[0].measured == "ZeroDivisionError: no cycle was recorded"

"""What plugins add to nodes: that one which fails leaves the others and the node."""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Any

import pytest
from joshua.node.extensions import ExtendedNode, extend
from joshua.plan import NodeKind, NodeSpec
from joshua.plugins.specs import ExtensionSpec
from joshua.plugins.verify import verify_specs
from joshua.testing.recording_context import RecordingContext


def test_an_extension_that_fails_is_a_warning_and_the_others_run(monkeypatch: pytest.MonkeyPatch) -> None:
    added: list[str] = []

    def fail(node: ExtendedNode) -> None:
        raise ValueError("no such type")

    plugin = ModuleType("acme_graph")
    vars(plugin).update(add=lambda node: added.append(node.context.spec.full_name), fail=fail)
    monkeypatch.setitem(sys.modules, "acme_graph", plugin)
    spec = NodeSpec(
        name="arm",
        kind=NodeKind.SERVICE,
        behaviour="x:X",
        implementation="x:X",
        extensions=("acme_graph:fail", "joshua_not_there:add", "acme_graph:add"),
    )
    context: Any = RecordingContext(spec)
    nothing: Any = None
    extend(ExtendedNode(context, nothing, (), nothing, nothing))
    assert added == ["/arm"]
    assert context.warnings[0] == "/arm: acme_graph:fail failed: ValueError: no such type"
    assert "joshua_not_there" in context.warnings[1]
    assert len(context.warnings) == 2


def test_an_extension_is_asked_for_by_nothing_and_several_may_be_there() -> None:
    specs = [ExtensionSpec(name=name, implementation="acme.graph:add") for name in ("one", "two")]
    assert verify_specs(specs[:1]) == verify_specs(specs[1:]) == []

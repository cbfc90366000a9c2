"""The context of tests offers what the runtime's own offers."""

from __future__ import annotations

import inspect

from joshua.node.behaviour import NodeContext
from joshua.plan import NodeKind, NodeSpec
from joshua.testing.recording_context import RecordingContext


def test_it_takes_every_call_that_a_behaviour_may_make() -> None:
    context: NodeContext = RecordingContext(
        NodeSpec(name="a", kind=NodeKind.SENSOR, behaviour="", implementation="")
    )
    for name, member in vars(NodeContext).items():
        if name.startswith("_") or not inspect.isfunction(member):
            continue
        wanted = inspect.signature(member).parameters
        there = inspect.signature(getattr(RecordingContext, name)).parameters
        assert list(there)[: len(wanted)] == list(wanted), name
        assert [parameter.kind for parameter in there.values()][: len(wanted)] == [
            parameter.kind for parameter in wanted.values()
        ], name
    context.spawn_thread(lambda: None, name="reader", hang_after_s=30.0)
    context.waiting_for("the router")
    context.end_run("all is done")
    assert isinstance(context, RecordingContext)
    assert (context.waits, context.ends) == ("the router", ["all is done"])
    context.stop()

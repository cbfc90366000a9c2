"""The context of tests replaces all of the runtime's own that a behaviour may call."""

from __future__ import annotations

import inspect

from joshua.node.context import NodeContext
from joshua.plan import NodeKind, NodeSpec
from joshua.testing.recording_context import RecordingContext

#: What only the runtime calls.
OF_THE_RUNTIME = {"fail_with", "request_stop", "reader_ages", "join_readers"}


def test_it_takes_every_call_that_a_behaviour_may_make() -> None:
    for name, member in vars(NodeContext).items():
        if inspect.isfunction(member) and not name.startswith("_") and name not in OF_THE_RUNTIME:
            assert name in vars(RecordingContext), name
    context = RecordingContext(NodeSpec(name="a", kind=NodeKind.SENSOR, behaviour="", implementation=""))
    context.spawn_thread(lambda: None, name="reader", hang_after_s=30.0)
    context.waiting_for("the router")
    context.end_run("all is done")
    assert (context.waits, context.ends) == ("the router", ["all is done"])
    context.stop()

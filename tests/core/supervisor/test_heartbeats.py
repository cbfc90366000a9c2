"""What counts as a hang."""

from __future__ import annotations

import pytest
from joshua.guardian.order import HANG_LIMIT_S
from joshua.guardian.silence import ThreadTime
from joshua.ipc.messages import Heartbeat, ThreadAge
from joshua.plan import ActuatorFacts, NodeKind, NodeSpec
from joshua.schema import config_pb2 as pb
from joshua.schema.rules import rule
from joshua.supervisor.heartbeats import CHECK_PERIOD_S, HANG_AFTER_S, HeartbeatWatch, hang_limit_s

ARM = NodeSpec(name="arm", kind=NodeKind.ACTUATOR, behaviour="a:B", implementation="")


def beat(*threads, thread_id=7):
    return Heartbeat(node="/arm", stamp_ns=0, thread_id=thread_id, threads=threads)


class Watched:
    """A watch over the nodes of a process, whose time passes in the hands of the test."""

    def __init__(self, loop=lambda _thread_id: None):
        self.now_s = 100.0
        self.watch = HeartbeatWatch(loop, lambda: self.now_s)
        self.watch.begin(ARM)

    def hung_until(self, end_s):
        while self.now_s < end_s - 1e-6:
            self.now_s += CHECK_PERIOD_S
            if hang := self.watch.hung():
                return hang
        return None


def test_an_actuator_hangs_after_the_default_limit():
    field = pb.SingleAction.DESCRIPTOR.fields_by_name["hang_after_s"]
    assert HANG_AFTER_S[NodeKind.ACTUATOR] == HANG_LIMIT_S == float(rule(field).default)
    watched = Watched()
    watched.watch.hear(beat())
    assert watched.hung_until(100.25) is None
    assert watched.hung_until(100.35) == ("/arm", "its loop has not run for 0.35 s (limit 0.3 s)")


def test_a_heartbeat_ends_a_silence():
    watched = Watched()
    assert watched.hung_until(100.25) is None
    watched.watch.hear(beat())
    assert watched.hung_until(100.5) is None
    assert watched.hung_until(100.6) is not None


def test_a_process_that_waits_for_a_processor_is_starved_not_hung_but_not_for_ever():
    asked = []

    def loop(thread_id):
        asked.append(thread_id)
        return ThreadTime(5, 5, runnable=True)

    watched = Watched(loop)
    watched.watch.hear(beat())
    assert watched.hung_until(101.45) is None
    assert watched.hung_until(101.55) is not None
    assert set(asked) == {0, 7}, "the main thread before the first heartbeat, then the loop's"


def test_a_reader_thread_has_a_limit_of_its_own():
    watched = Watched()
    watched.watch.hear(beat(ThreadAge(name="reader", age_s=4.9, limit_s=5.0)))
    assert watched.watch.hung() is None
    watched.watch.hear(beat(ThreadAge(name="reader", age_s=5.2, limit_s=5.0)))
    assert watched.watch.hung() == (
        "/arm",
        "its thread 'reader' has not run for 5.2 s (limit 5 s)",
    )


def test_a_time_in_which_nobody_listened_is_excused():
    watched = Watched()
    watched.now_s = 150.0
    assert watched.watch.hung() is None
    assert watched.hung_until(150.3) is not None


def test_nothing_is_watched_before_the_begin_and_after_the_end():
    heart = HeartbeatWatch(lambda _thread_id: None, lambda: 1.0)
    heart.hear(beat())
    assert not heart.active
    assert heart.hung() is None
    heart.begin(ARM)
    assert heart.active
    heart.end()
    assert heart.hung() is None


@pytest.mark.parametrize(("value", "limit"), [(3, 3.0), (0.05, 0.05), (0, 0.3), (-1, 0.3)])
def test_the_plan_can_set_a_limit(value, limit):
    assert hang_limit_s(ARM.model_copy(update={"facts": ActuatorFacts(hang_after_s=value)})) == limit

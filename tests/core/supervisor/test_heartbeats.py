"""What counts as a hang."""

from __future__ import annotations

import os
import threading
import time

import pytest
from joshua.ipc.messages import Heartbeat, ThreadAge
from joshua.plan import NodeKind, NodeSpec
from joshua.supervisor.heartbeats import (
    HANG_AFTER_S,
    HeartbeatWatch,
    ProcessorTime,
    hang_limit_s,
    processor_time,
)

ARM = NodeSpec(name="arm", kind=NodeKind.ACTUATOR, behaviour="a:B", implementation="")


def beat(now_s, *threads):
    return Heartbeat(node="/arm", stamp_ns=round(now_s * 1e9), threads=threads)


def idle(_thread_id):
    return ProcessorTime(1.0, 1.0)


def watch(usage=idle, spec=ARM):
    made = HeartbeatWatch(usage)
    made.begin(spec, 100.0)
    return made


def test_an_actuator_hangs_after_a_fifth_of_a_second():
    assert HANG_AFTER_S[NodeKind.ACTUATOR] == 0.2
    heart = watch()
    heart.hear(beat(101.0))
    assert heart.hung(101.19) is None
    assert heart.hung(101.25) == ("/arm", "its loop has not turned for 0.25 s (limit 0.2 s)")


def test_a_heartbeat_that_was_sent_in_time_counts_even_if_it_was_read_late():
    heart = watch()
    heart.hear(beat(105.0))
    heart.hear(beat(104.0))
    assert heart.hung(105.15) is None


def test_a_process_that_waits_for_a_processor_is_starved_not_hung_but_not_for_ever():
    now = [100.0]
    heart = watch(lambda _thread_id: ProcessorTime(1.0, now[0]))
    for now[0] in (100.12, 100.22, 100.5, 101.0, 101.9):
        assert heart.hung(now[0]) is None
    now[0] = 102.1
    assert heart.hung(now[0]) is not None


def test_a_thread_that_has_waited_all_the_time_may_hold_what_the_loop_needs():
    seen = ProcessorTime(1.0, 1.0, ready=frozenset({("77", 5)}))
    heart = watch(lambda _thread_id: seen)
    assert heart.hung(100.12) is None
    assert heart.hung(100.25) is None
    seen = ProcessorTime(1.0, 1.0, ready=frozenset({("77", 6)}))
    assert heart.hung(100.3) is not None, "it ran meanwhile"


def test_a_process_that_is_busy_is_hung_although_it_waits_at_times():
    now = [100.0]
    heart = watch(lambda _thread_id: ProcessorTime(now[0], 0.6 * now[0]))
    now[0] = 100.12
    assert heart.hung(now[0]) is None
    now[0] = 100.25
    assert heart.hung(now[0]) is not None


@pytest.mark.parametrize(("waited_s", "is_hung"), [(0.3, False), (0.1, True)])
def test_the_time_that_a_busy_loop_waits_for_a_processor_is_none_of_its_own(waited_s, is_hung):
    """A loop that has much to do needs longer for it on a busy machine: that is no hang."""
    share = [0.0]
    heart = watch(lambda _thread_id: ProcessorTime(5.0 + share[0] * 0.05, 9.0, 7.0 + share[0] * waited_s))
    assert heart.hung(100.12) is None
    share[0] = 1.0
    assert (heart.hung(100.45) is not None) == is_hung


def test_a_loop_that_waits_for_a_processor_all_the_time_is_not_hung():
    heart = watch(lambda _thread_id: ProcessorTime(5.0, 9.0, 7.0, loop_is_runnable=True))
    assert heart.hung(100.12) is None
    assert heart.hung(100.45) is None
    assert heart.hung(102.1) is not None, "but not for ever"


def test_a_system_that_tells_no_times_is_no_excuse():
    heart = watch(lambda _thread_id: None)
    assert heart.hung(100.3) is not None


def test_a_reader_thread_has_a_limit_of_its_own():
    heart = watch()
    heart.hear(beat(100.0, ThreadAge(name="reader", age_s=4.9, limit_s=5.0)))
    assert heart.hung(100.0) is None
    heart.hear(beat(100.1, ThreadAge(name="reader", age_s=5.2, limit_s=5.0)))
    assert heart.hung(100.1) == (
        "/arm",
        "its thread 'reader' has shown no sign of life for 5.2 s (limit 5 s)",
    )


def test_a_time_in_which_nobody_listened_is_excused():
    heart = watch()
    heart.excuse(50.0, 150.1)
    assert heart.hung(150.1) is None
    assert heart.hung(150.3) is not None


def test_an_excuse_never_reaches_into_the_future():
    heart = watch()
    heart.hear(beat(150.0))
    heart.excuse(50.0, 150.1)
    assert heart.hung(150.4) is not None


def test_nothing_is_watched_before_the_begin_and_after_the_end():
    heart = HeartbeatWatch(idle)
    heart.hear(beat(1.0))
    assert not heart.active
    assert heart.hung(1e9) is None
    heart.begin(ARM, 0.0)
    heart.end()
    assert heart.hung(1e9) is None


@pytest.mark.parametrize(
    ("value", "limit"), [(3, 3.0), (0.05, 0.05), (0, 0.2), (-1, 0.2), ("x", 0.2), (None, 0.2)]
)
def test_the_plan_can_set_a_limit(value, limit):
    assert hang_limit_s(ARM.model_copy(update={"context": {"hang_after_s": value}})) == limit


@pytest.mark.skipif(not os.path.exists("/proc/self/schedstat"), reason="needs Linux with sched stats")
def test_processor_time_grows_with_work():
    before = processor_time(os.getpid(), threading.get_native_id())
    end = time.process_time() + 0.05
    while time.process_time() < end:
        pass
    after = processor_time(os.getpid(), threading.get_native_id())
    assert after.loop_ran_s > before.loop_ran_s
    assert after.waited_s >= before.waited_s
    assert str(threading.get_native_id()) in {thread for thread, _ in after.ready}
    assert processor_time(2**22 + 1, 1) in (None, ProcessorTime(0.0, 0.0))

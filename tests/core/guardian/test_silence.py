"""Silence on a clock that stands still while its process is held up, and what of it counts as a hang."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time

import pytest
from joshua.guardian.silence import (
    LONGEST_LOOK_S,
    WATCHER_LOOK_S,
    AwakeClock,
    SilenceJudge,
    ThreadTime,
    thread_time,
)

TICK_S = 0.06


def test_time_counts_while_somebody_looks_and_not_while_the_process_is_held_up() -> None:
    now = [100.0]
    clock = AwakeClock(lambda: now[0])
    assert clock.now_s() == 0.0
    for _ in range(50):
        now[0] += 0.02
        clock.now_s()
    assert clock.now_s() == pytest.approx(1.0)
    now[0] += 5.0  # nobody ran
    assert clock.now_s() == pytest.approx(1.0 + LONGEST_LOOK_S)
    now[0] += 0.1
    assert clock.now_s() == pytest.approx(1.1 + LONGEST_LOOK_S)
    assert clock.missed_s(0.0, 200.0) == pytest.approx(5.0 - LONGEST_LOOK_S)
    assert clock.missed_s(103.0, 104.0) == 1.0
    assert clock.missed_s(0.0, 101.0) == 0.0


STOPPED = """
import time
from joshua.guardian.silence import witness
clock = witness()
assert clock is witness()
print("ready", flush=True)
start_s = time.monotonic()
while clock.missed_s(start_s, time.monotonic()) < 0.2:
    time.sleep(0.01)
"""


def test_a_process_notes_that_it_was_stopped() -> None:
    with subprocess.Popen([sys.executable, "-c", STOPPED], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"ready\n"
        time.sleep(0.05)
        process.send_signal(signal.SIGSTOP)
        time.sleep(0.5)
        process.send_signal(signal.SIGCONT)
        assert process.wait(60) == 0


class Loop:
    """A control loop whose share of the processor is given, and its judge, whose time is."""

    def __init__(self) -> None:
        self.now_s = 1.0
        self.time: ThreadTime | None = ThreadTime(0, 0, False)
        self.ran_ns_per_look = 0
        clock = AwakeClock(lambda: self.now_s, WATCHER_LOOK_S)
        self.judge = SilenceJudge(0.2, clock, lambda: self.time)

    def hangs_until(self, end_s: float) -> bool:
        """Whether it counts as hung in looks up to a time."""
        while self.now_s < end_s:
            self.now_s += TICK_S
            if self.time is not None:
                self.time = self.time._replace(ran_ns=self.time.ran_ns + self.ran_ns_per_look)
            if self.judge.hung():
                return True
        return False


def test_silence_beyond_the_limit_is_a_hang() -> None:
    loop = Loop()
    assert not loop.hangs_until(1.1)
    assert loop.hangs_until(1.21)
    assert loop.judge.silence_s() == pytest.approx(0.24)


def test_a_machine_that_stood_still_is_no_hang() -> None:
    loop = Loop()
    loop.now_s = 61.0
    assert not loop.judge.hung()
    assert loop.judge.left_s() == pytest.approx(0.2 - WATCHER_LOOK_S)
    assert loop.hangs_until(61.2), "but it has to show itself afterwards"


def test_a_loop_that_waits_for_a_processor_does_not_hang_yet() -> None:
    loop = Loop()
    loop.time = ThreadTime(0, 0, True)
    assert not loop.hangs_until(1.9)
    assert loop.hangs_until(2.1), "but not for ever"


def test_a_loop_that_ran_after_its_heartbeat_and_waits_since_then_does_not_hang_yet() -> None:
    """The kernel adds the time of a wait up only when it ends."""
    loop = Loop()
    loop.time = ThreadTime(1_000_000, 90_000_000, True)
    assert not loop.hangs_until(1.9)
    assert loop.hangs_until(2.1), "but not for ever"


def test_a_loop_that_is_busy_with_something_else_hangs() -> None:
    loop = Loop()
    loop.ran_ns_per_look = 5_000_000
    loop.time = ThreadTime(200_000_000, 0, True)
    assert loop.hangs_until(1.25)


@pytest.mark.parametrize(("waited_s", "hangs"), [(0.3, False), (0.1, True)])
def test_the_time_that_a_busy_loop_waits_for_a_processor_is_none_of_its_own(
    waited_s: float, hangs: bool
) -> None:
    """A loop that has much to do needs longer for it on a busy machine: that is no hang."""
    loop = Loop()
    loop.time = ThreadTime(50_000_000, round(waited_s * 1e9), False)
    assert loop.hangs_until(1.45) is hangs


def test_a_system_that_tells_no_times_is_no_excuse() -> None:
    loop = Loop()
    loop.time = None
    assert loop.hangs_until(1.25)


@pytest.mark.skipif(not os.path.exists("/proc/self/schedstat"), reason="needs Linux with sched stats")
def test_the_times_of_a_thread_grow_with_its_work() -> None:
    thread = threading.get_native_id()
    before = thread_time(os.getpid(), thread)
    end = time.process_time() + 0.05
    while time.process_time() < end:
        pass
    after = thread_time(os.getpid(), thread)
    assert before is not None
    assert after is not None
    assert after.ran_ns > before.ran_ns
    assert after.waited_ns >= before.waited_ns
    assert after.runnable
    assert thread_time(2**22 + 1, 1) is None

"""The stop ladder and the restart policy."""

from __future__ import annotations

import time

import pytest
from joshua.supervisor.policies import LadderTimes, RestartLimits, RestartPolicy, Rung, StopLadder
from joshua.supervisor.reactor import Reactor


def climb(times, until, act=lambda ladder, rung: None):
    reactor, taken = Reactor(), []

    def step(rung: Rung, _elapsed_s: float) -> None:
        taken.append(rung)
        act(ladder, rung)

    ladder = StopLadder(reactor, times, step)
    ladder.begin()
    ladder.begin()
    reactor.call_later(10.0, lambda: None)
    deadline = time.monotonic() + 10.0
    while taken[-1] is not until and time.monotonic() < deadline:
        reactor.turn()
    reactor.close()
    return taken


def test_the_rungs_follow_each_other_up_to_the_kill():
    assert climb(LadderTimes(0.01, 0.01), Rung.KILL) == [Rung.REQUEST, Rung.TERMINATE, Rung.KILL]


def test_a_process_that_ends_is_not_signalled():
    reactor = Reactor()
    taken: list[Rung | str] = []
    ladder = StopLadder(reactor, LadderTimes(0.01, 0.01), lambda rung, elapsed_s: taken.append(rung))
    ladder.begin()
    ladder.ended()
    reactor.call_later(0.05, lambda: taken.append("later"))
    while taken[-1] != "later":
        reactor.turn()
    assert taken == [Rung.REQUEST, "later"]
    reactor.close()


def test_a_kill_jumps_to_the_last_rung_once():
    reactor, taken = Reactor(), []
    ladder = StopLadder(reactor, LadderTimes(5.0, 5.0), lambda rung, elapsed_s: taken.append(rung))
    ladder.kill()
    ladder.kill()
    assert taken == [Rung.KILL]
    assert ladder.begun
    reactor.close()


def test_the_elapsed_time_is_told():
    elapsed = []
    reactor = Reactor()
    ladder = StopLadder(reactor, LadderTimes(0.05, 0.05), lambda rung, seconds: elapsed.append(seconds))
    ladder.begin()
    while len(elapsed) < 3:
        reactor.turn()
    assert elapsed[0] < elapsed[1] < elapsed[2]
    assert elapsed[1] >= 0.05
    reactor.close()


LIMITS = RestartLimits(first_delay_s=0.5, factor=2.0, max_delay_s=3.0, failures=5, window_s=60.0)


def test_pauses_grow_up_to_a_bound_and_then_it_gives_up():
    policy = RestartPolicy(["on-failure"], LIMITS)
    decisions = [policy.failed(float(second)) for second in range(5)]
    assert decisions == [0.5, 1.0, 2.0, 3.0, "it failed 5 times within 60 s"]


def test_old_failures_are_forgotten():
    policy = RestartPolicy(["on-failure"], LIMITS)
    assert [policy.failed(100.0 * index) for index in range(10)] == [0.5] * 10


@pytest.mark.parametrize("name", ["never", "stop-run"])
def test_other_policies_do_not_restart(name):
    policy = RestartPolicy([name], LIMITS)
    assert policy.failed(0.0) == f"its restart policy is {name!r}"
    assert policy.stops_run is (name == "stop-run")


def test_a_group_follows_its_strictest_member():
    for policies, strictest in (
        (["on-failure", "never"], "never"),
        (["never", "stop-run", "on-failure"], "stop-run"),
        (["on-failure"], "on-failure"),
    ):
        assert RestartPolicy(policies, LIMITS).policy == strictest

"""The restart policy."""

from __future__ import annotations

import pytest
from joshua.supervisor.restart import RestartLimits, RestartPolicy

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

"""Timers: absolute deadlines, skipped ticks, order, cadence figures."""

from __future__ import annotations

import pytest
from joshua.node.timers import Timer, TimerQueue

MS = 1_000_000


class Clock:
    def __init__(self):
        self.now_ns = 1_000_000_000

    def __call__(self):
        return self.now_ns


@pytest.fixture
def clock():
    return Clock()


@pytest.mark.parametrize("period", [0.0, -1.0, float("nan"), float("inf")])
def test_a_period_that_is_not_positive_is_refused_with_the_name(period):
    with pytest.raises(ValueError, match=r"timer 'control': the period is .* it must be positive"):
        Timer(period, print, "control")


def test_ticks_do_not_drift_when_each_comes_late(clock):
    ticks = []
    queue = TimerQueue(clock)
    queue.add(Timer(0.01, lambda: ticks.append(clock.now_ns), "t"))
    queue.start()
    start_ns = clock.now_ns
    for _ in range(100):
        wait_ns = queue.run_due()
        assert wait_ns is not None
        clock.now_ns += wait_ns + 3 * MS

    queue.run_due()
    assert len(ticks) == 100
    assert ticks[-1] - start_ns == 100 * 10 * MS + 3 * MS


def test_missed_ticks_are_skipped_and_counted(clock):
    queue = TimerQueue(clock)
    ticks = []
    timer = Timer(0.01, lambda: ticks.append(clock.now_ns), "t")
    queue.add(timer)
    queue.start()

    clock.now_ns += 47 * MS
    assert queue.run_due() == 3 * MS
    assert len(ticks) == 1
    report = timer.cadence.report()
    assert (report.ticks, report.overruns) == (1, 3)
    assert report.jitter_max_s == pytest.approx(0.037)


def test_a_callback_that_takes_longer_than_the_period_counts_overruns(clock):
    queue = TimerQueue(clock)

    def slow():
        clock.now_ns += 25 * MS

    timer = Timer(0.01, slow, "t")
    queue.add(timer)
    queue.start()
    for _ in range(20):
        wait_ns = queue.run_due()
        clock.now_ns += wait_ns
    report = timer.cadence.report()
    assert report.overruns > report.ticks
    assert report.achieved_hz == pytest.approx(40.0)


def test_periods_that_a_schedule_skips_count_as_overruns(clock):
    timer = Timer(0.01, lambda: None, "t")
    timer.start(clock.now_ns)
    first_ns = clock.now_ns + 10 * MS
    timer.schedule(first_ns - 3 * MS)
    timer.schedule(first_ns + 1 * MS)
    assert timer.cadence.report().overruns == 0
    timer.schedule(first_ns + 31 * MS)
    assert timer.cadence.report().overruns == 3


def test_a_tick_that_waits_leaves_the_deadlines_where_they_are(clock):
    queue = TimerQueue(clock)
    ticks = []
    timer = Timer(0.01, lambda: ticks.append(clock.now_ns), "t")
    queue.add(timer)
    queue.start()
    start_ns = clock.now_ns
    timer.wait_until(start_ns + 14 * MS)
    clock.now_ns += 12 * MS
    assert queue.run_due() == 2 * MS
    assert ticks == []
    clock.now_ns += 2 * MS
    assert queue.run_due() == 6 * MS
    assert ticks == [start_ns + 14 * MS]
    assert timer.cadence.report().overruns == 0


def test_the_most_overdue_timer_runs_first(clock):
    order = []
    queue = TimerQueue(clock)
    queue.add(Timer(0.010, lambda: order.append("slow"), "slow"))
    queue.add(Timer(0.004, lambda: order.append("fast"), "fast"))
    queue.start()
    clock.now_ns += 10 * MS
    queue.run_due()
    assert order == ["fast", "slow"]


def test_a_timer_added_later_starts_one_period_later(clock):
    queue = TimerQueue(clock)
    assert queue.run_due() is None
    queue.start()
    ticks = []
    queue.add(Timer(0.01, lambda: ticks.append(1), "t"))
    assert queue.run_due() == 10 * MS
    clock.now_ns += 10 * MS
    queue.run_due()
    assert ticks == [1]


def test_the_report_names_rate_and_jitter(clock):
    queue = TimerQueue(clock)
    timer = Timer(0.02, lambda: None, "control")
    queue.add(timer)
    queue.start()
    for _ in range(51):
        clock.now_ns += queue.run_due()
    queue.run_due()
    report = timer.cadence.report()
    assert (report.name, report.period_s, report.ticks) == ("control", 0.02, 51)
    assert report.achieved_hz == pytest.approx(50.0)
    assert report.jitter_p999_s == 0.0

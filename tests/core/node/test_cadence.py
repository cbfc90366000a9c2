"""Figures of timers and topics, and the limit of a publisher."""

from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from joshua.guardian.silence import AwakeClock
from joshua.node.cadence import DurationHistogram, RateLimit, TrafficFigures
from joshua.node.endpoints import Outputs
from joshua.plan import TopicSpec
from joshua.testing.recording_context import RecordingPublisher

TOPIC = TopicSpec(name="/x", type_name="std_msgs/msg/String", rate_hz=50.0)


def test_a_publisher_is_measured_against_its_rate():
    figures = TrafficFigures(TOPIC, is_publisher=True)
    for index in range(101):
        figures.add(index * 20_000_000 + (1_000_000 if index == 50 else 0))

    report = figures.report()
    assert (report.name, report.count, report.is_publisher, report.configured_hz) == ("/x", 101, True, 50.0)
    assert report.rate_hz == pytest.approx(50.0)
    assert report.jitter_p50_s == 0.0
    assert report.jitter_p999_s == pytest.approx(0.001, rel=0.05)


def test_without_a_rate_there_is_no_jitter():
    figures = TrafficFigures(TOPIC.model_copy(update={"rate_hz": 0.0}), is_publisher=False)
    figures.add(0)
    assert figures.report().rate_hz == 0.0
    figures.add(10**9)
    figures.add(3 * 10**9)
    report = figures.report()
    assert (report.rate_hz, report.jitter_p999_s, report.count) == (pytest.approx(2 / 3), 0.0, 3)


def watched(rate_hz: float) -> tuple[list[int], AwakeClock, TrafficFigures]:
    """Figures that know when their process was held up, and the clock of both, which the test sets."""
    now_ns = [0]
    held = AwakeClock(lambda: now_ns[0] / 1e9, 0.04)
    topic = TOPIC.model_copy(update={"rate_hz": rate_hz})
    return now_ns, held, TrafficFigures(topic, is_publisher=True, witness=held)


@pytest.mark.parametrize(("rate_hz", "passed"), [(50.0, True), (60.0, False), (35.0, False)])
def test_a_system_stall_is_not_the_fault_of_the_device(rate_hz: float, passed: bool) -> None:
    now_ns, held, figures = watched(rate_hz)
    for tick in range(100):
        now_ns[0] += 20_000_000 if tick != 50 else 500_000_000
        held.now_s()
        figures.add(now_ns[0])
    assert figures.check() == (
        "rate of /x",
        passed,
        f"40.24 Hz of {rate_hz:g} Hz, 100 messages, 49.5 Hz excluding a 0.5 s system stall",
    )
    assert held.missed_s(0.0, 1.0) == 0


def test_a_device_that_pauses_is_found() -> None:
    now_ns, held, figures = watched(50.0)
    for tick in range(100):
        for _ in range(1 if tick != 50 else 25):
            now_ns[0] += 20_000_000
            held.now_s()
        figures.add(now_ns[0])
    assert figures.check()[1:] == (False, "40.24 Hz of 50 Hz, 100 messages")


def test_a_rate_within_a_tenth_passes() -> None:
    assert watched(10.0)[2].check() == ("rate of /x", False, "0 Hz of 10 Hz, 0 messages")
    for rate_hz, passed in ((10.5, True), (12.0, False)):
        _, _, figures = watched(rate_hz)
        for now_ns in range(0, 400_000_000, 100_000_000):
            figures.add(now_ns)
        assert figures.check()[1:] == (passed, f"10 Hz of {rate_hz:g} Hz, 4 messages")


def test_no_durations_have_no_quantiles():
    histogram = DurationHistogram()
    assert (histogram.count, histogram.maximum_ns, histogram.quantile_ns(0.5)) == (0, 0, 0)


@given(st.lists(st.integers(0, 2**41), min_size=1, max_size=200), st.sampled_from([0.5, 0.99, 0.999, 1.0]))
def test_quantiles_are_within_four_per_cent_of_the_exact_ones(durations, fraction):
    histogram = DurationHistogram()
    for duration in durations:
        histogram.add(duration)

    ordered = sorted(durations)
    wanted = fraction * len(ordered)
    exact = next(value for index, value in enumerate(ordered, 1) if index >= wanted)
    assert exact <= histogram.quantile_ns(fraction) <= exact * 1.04 + 1
    assert histogram.maximum_ns == ordered[-1]
    assert histogram.count == len(ordered)


def test_memory_does_not_grow_and_odd_durations_fit():
    histogram = DurationHistogram()
    buckets = len(histogram._counts)
    generator = random.Random(1)
    for _ in range(10_000):
        histogram.add(generator.randrange(-5, 2**60))
    assert len(histogram._counts) == buckets < 2000
    assert histogram.quantile_ns(0.0) >= 0


@pytest.mark.parametrize("duration", [0, 1, 31, 32, 33, 63, 64, 65, 1000, 2**41])
def test_one_duration_is_its_own_quantile(duration):
    histogram = DurationHistogram()
    histogram.add(duration)
    assert histogram.quantile_ns(0.999) == duration


@pytest.mark.parametrize(
    ("source_hz", "limit_hz", "expected_hz"),
    [
        (30, 30, 30),
        (30, 10, 10),
        (30, 20, 20),
        (29.97, 30, 29.97),
        (30.3, 30, 30),
        (100, 30, 30),
        (10, 50, 10),
    ],
)
def test_a_stream_is_thinned_to_the_rate(source_hz: float, limit_hz: float, expected_hz: float) -> None:
    limit = RateLimit(limit_hz)
    seconds = 60
    jitter = [0, 3_000_000, -2_000_000, 1_000_000]
    stamps = [round(k * 1e9 / source_hz) + jitter[k % 4] for k in range(round(seconds * source_hz))]
    passed = [stamp for stamp in stamps if limit.passes(stamp)]
    assert len(passed) / seconds == pytest.approx(expected_hz, rel=0.02)


def test_a_gap_is_not_made_up_for() -> None:
    limit = RateLimit(10.0)
    assert limit.passes(0)
    assert limit.passes(10_000_000_000)
    burst = [10_000_000_000 + k * 10_000_000 for k in range(1, 11)]
    assert sum(limit.passes(stamp) for stamp in burst) <= 1


def test_a_device_that_counts_from_the_start_again_is_not_locked_out() -> None:
    limit = RateLimit(10.0)
    assert limit.passes(5_000_000_000)
    assert limit.passes(1_000_000_000)
    assert not limit.passes(1_010_000_000)
    assert limit.passes(1_100_000_000)


def test_only_a_publisher_that_is_slower_than_its_source_is_thinned() -> None:
    slow, fast = (RecordingPublisher(TOPIC.model_copy(update={"rate_hz": rate})) for rate in (10.0, 50.0))
    outputs = Outputs((slow, fast), 50.0)
    for stamp_ns in range(0, 1_000_000_000, 20_000_000):
        outputs.publish(stamp_ns, lambda name: name)
    assert (len(slow.messages), len(fast.messages)) == (10, 50)
    assert fast.messages[0] == TOPIC.type_name
    assert [name for name, _, _ in outputs.checks()] == ["rate of /x"] * 2

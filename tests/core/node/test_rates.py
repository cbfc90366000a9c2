from __future__ import annotations

import pytest
from joshua.guardian.silence import AwakeClock
from joshua.node.rates import RateLimit, RateMeter, limit_below


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


def test_a_publisher_as_fast_as_its_source_needs_no_limit() -> None:
    assert limit_below(50.0, 50.0) is None
    assert limit_below(10.0, 50.0) is not None


def watched_meter() -> tuple[list[int], AwakeClock, RateMeter]:
    """A meter that knows when its process was held up, and the clock of both, which the test sets."""
    now_ns = [0]
    held = AwakeClock(lambda: now_ns[0] / 1e9, 0.04)
    return now_ns, held, RateMeter(lambda: now_ns[0], held)


def test_a_machine_that_stood_still_is_no_fault_of_the_device() -> None:
    now_ns, held, meter = watched_meter()
    for tick in range(100):
        now_ns[0] += 20_000_000 if tick != 50 else 500_000_000
        held.now_s()
        meter.add()
    assert meter.check("rate", 50.0) == (
        "rate",
        True,
        "40.24 Hz of 50 Hz, 100 messages, 49.5 Hz without 0.5 s in which this machine stood still",
    )
    assert not meter.check("rate", 60.0)[1]
    assert not meter.check("rate", 35.0)[1]
    assert held.missed_s(0.0, 1.0) == 0


def test_a_device_that_pauses_is_found() -> None:
    now_ns, held, meter = watched_meter()
    for tick in range(100):
        for _ in range(1 if tick != 50 else 25):
            now_ns[0] += 20_000_000
            held.now_s()
        meter.add()
    assert meter.check("rate", 50.0)[1:] == (False, "40.24 Hz of 50 Hz, 100 messages")


def test_the_meter_measures_between_the_first_and_the_last() -> None:
    times = iter([0, 100_000_000, 200_000_000, 300_000_000])
    meter = RateMeter(lambda: next(times))
    assert meter.check("rate", 10.0) == ("rate", False, "0 Hz of 10 Hz, 0 messages")
    for _ in range(4):
        meter.add()
    assert meter.rate_hz == pytest.approx(10.0)
    assert meter.check("rate", 10.5) == ("rate", True, "10 Hz of 10.5 Hz, 4 messages")
    assert meter.check("rate", 12.0) == ("rate", False, "10 Hz of 12 Hz, 4 messages")

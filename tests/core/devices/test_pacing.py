from __future__ import annotations

import time

import pytest
from joshua.devices.pacing import FreeRunningClock, RateLimit
from joshua.devices.stamps import StampClock


def test_the_clock_does_not_drift() -> None:
    clock = FreeRunningClock(200.0)
    started = time.monotonic()
    ticks = [clock.wait(5.0) for _ in range(40)]
    elapsed = time.monotonic() - started
    first, last = ticks[0], ticks[-1]
    assert first is not None
    assert last is not None
    assert last.stamp_ns - first.stamp_ns == pytest.approx((last.sequence - first.sequence) * 5e6, abs=5)
    # a reader cannot be ahead of the clock
    assert last.sequence <= elapsed * 200.0 + 1
    assert abs(last.stamp_ns - time.time_ns()) < 5e9


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


def test_stamps_never_run_backwards(monkeypatch: pytest.MonkeyPatch) -> None:
    times = iter([1000, 500, 500, 2000])
    monkeypatch.setattr("joshua.devices.stamps.time.time_ns", lambda: next(times))
    clock = StampClock()
    assert [clock.now_ns() for _ in range(4)] == [1000, 1001, 1002, 2000]

"""Rates of timers and topics: how accurately they are met, and the limit of a publisher."""

from __future__ import annotations

import time
from collections import deque

from joshua.guardian.silence import AwakeClock
from joshua.plan import TimerReport, TopicReport, TopicSpec

NS_PER_S = 1_000_000_000

#: Buckets per power of two; more would be finer and larger.
SUB_BUCKET_BITS = 5
_SUB_BUCKETS = 1 << SUB_BUCKET_BITS

#: Durations from 2**42 ns (73 minutes) on share the last bucket.
_MAXIMUM_BITS = 42

#: Number of messages whose time on the way is kept.
_TRANSITS = 60


class DurationHistogram:
    """Counts durations in logarithmic buckets, as HDR histograms do: each power of two is divided equally.

    Attributes:
        count: durations so far; maximum_ns: the longest one, exactly, 0 for none.
    """

    def __init__(self) -> None:
        self._counts = [0] * ((_MAXIMUM_BITS - SUB_BUCKET_BITS + 1) * _SUB_BUCKETS)
        self.count = 0
        self.maximum_ns = 0

    def add(self, duration_ns: int) -> None:
        """Counts one duration; a negative one counts as 0."""
        duration_ns = max(0, duration_ns)
        self.count += 1
        self.maximum_ns = max(self.maximum_ns, duration_ns)
        shift = duration_ns.bit_length() - SUB_BUCKET_BITS - 1
        index = duration_ns if shift <= 0 else shift * _SUB_BUCKETS + (duration_ns >> shift)
        self._counts[min(index, len(self._counts) - 1)] += 1

    def quantile_ns(self, fraction: float) -> int:
        """The duration that ``fraction`` (0 to 1) of all durations do not exceed; 0 if there are none."""
        wanted = fraction * self.count
        seen = 0
        for index, count in enumerate(self._counts):
            seen += count
            if count and seen >= wanted:
                return min(self._upper_ns(index), self.maximum_ns)
        return self.maximum_ns

    @staticmethod
    def _upper_ns(index: int) -> int:
        shift = max(0, index // _SUB_BUCKETS - 1)
        if shift == 0:
            return index
        return ((index - shift * _SUB_BUCKETS + 1) << shift) - 1


class TimerCadence:
    """Figures of one timer; jitter is the lateness of its ticks."""

    def __init__(self, name: str, period_s: float) -> None:
        self._name = name
        self._period_s = period_s
        self._lateness = DurationHistogram()
        self._first_ns = 0
        self._last_ns = 0
        self._overruns = 0

    def tick(self, deadline_ns: int, started_ns: int) -> None:
        """Counts one tick that was due at ``deadline_ns`` and began at ``started_ns``."""
        if not self._lateness.count:
            self._first_ns = started_ns
        self._last_ns = started_ns
        self._lateness.add(started_ns - deadline_ns)

    def skip(self, ticks: int) -> None:
        """Counts ticks that were skipped because an earlier one took too long."""
        self._overruns += ticks

    def report(self) -> TimerReport:
        """The figures so far."""
        lateness = self._lateness
        return TimerReport(
            name=self._name,
            period_s=self._period_s,
            achieved_hz=rate_hz(lateness.count, self._last_ns - self._first_ns),
            jitter_p50_s=lateness.quantile_ns(0.50) / NS_PER_S,
            jitter_p99_s=lateness.quantile_ns(0.99) / NS_PER_S,
            jitter_p999_s=lateness.quantile_ns(0.999) / NS_PER_S,
            jitter_max_s=lateness.maximum_ns / NS_PER_S,
            ticks=lateness.count,
            overruns=self._overruns,
        )


class TrafficFigures:
    """Figures of one endpoint: number and rate of its messages and their deviation from a configured rate.

    Args:
        topic: of the endpoint; is_publisher: its direction.
        witness: knows when this process was stalled, which is no fault of the sender.

    Attributes:
        count: messages so far.
        transits_ns: time from publication to reception of the newest messages, minus the lead of the
            publisher's clock; empty if the publisher sends no time.
    """

    def __init__(self, topic: TopicSpec, *, is_publisher: bool, witness: AwakeClock | None = None) -> None:
        self.topic = topic
        self.count = 0
        self.transits_ns: deque[int] = deque(maxlen=_TRANSITS)
        self._is_publisher = is_publisher
        self._witness = witness
        self._period_ns = round(NS_PER_S / topic.rate_hz) if topic.rate_hz > 0 else 0
        self._deviation = DurationHistogram()
        self._first_ns = self._last_ns = 0

    def add(self, now_ns: int | None = None) -> None:
        """Counts one message at ``now_ns`` of the monotonic clock; None for now."""
        now_ns = time.monotonic_ns() if now_ns is None else now_ns
        if self.count == 0:
            self._first_ns = now_ns
        elif self._period_ns:
            self._deviation.add(abs(now_ns - self._last_ns - self._period_ns))
        self._last_ns = now_ns
        self.count += 1

    @property
    def rate_hz(self) -> float:
        """Mean rate between the first and the last message; 0 for fewer than two."""
        return rate_hz(self.count, self._last_ns - self._first_ns)

    def check(self, tolerance: float = 0.1) -> tuple[str, bool, str]:
        """A row of MODE_TEST: whether the rate is within a fraction of the configured one."""
        wanted_hz, least_hz, most_hz, remark = self.topic.rate_hz, self.rate_hz, self.rate_hz, ""
        elapsed_ns = self._last_ns - self._first_ns
        first_s, last_s = self._first_ns / NS_PER_S, self._last_ns / NS_PER_S
        held_ns = self._witness.missed_s(first_s, last_s) * NS_PER_S if self._witness else 0
        if 0 < held_ns < elapsed_ns:  # the number of missed messages is unknown
            most_hz *= elapsed_ns / (elapsed_ns - held_ns)
            remark = f", {most_hz:.4g} Hz excluding a {held_ns / NS_PER_S:.1f} s system stall"
        passed = least_hz <= wanted_hz * (1 + tolerance) and most_hz >= wanted_hz * (1 - tolerance)
        text = f"{least_hz:.4g} Hz of {wanted_hz:g} Hz, {self.count} messages{remark}"
        return (f"rate of {self.topic.name}", passed, text)

    def report(self) -> TopicReport:
        """The figures so far."""
        return TopicReport(
            name=self.topic.name,
            type_name=self.topic.type_name,
            is_publisher=self._is_publisher,
            count=self.count,
            rate_hz=self.rate_hz,
            configured_hz=self.topic.rate_hz,
            jitter_p50_s=self._deviation.quantile_ns(0.50) / NS_PER_S,
            jitter_p99_s=self._deviation.quantile_ns(0.99) / NS_PER_S,
            jitter_p999_s=self._deviation.quantile_ns(0.999) / NS_PER_S,
        )


def rate_hz(count: int, length_ns: int) -> float:
    """Events per second from their number and the time between the first and the last."""
    return (count - 1) * NS_PER_S / length_ns if length_ns > 0 else 0.0


class RateLimit:
    """Reduces a stream of stamped readings to a rate, without beating between the two rates.

    A reading passes if it is nearer to the next due time than the following reading would be, estimated by
    the distance of the last two. A 30 Hz camera published at 30 Hz therefore loses no frame to jitter.

    Args:
        rate_hz: largest rate of readings that pass, on average.
    """

    def __init__(self, rate_hz: float) -> None:
        self._period_ns = NS_PER_S / rate_hz
        self._due_ns: float | None = None
        self._last_ns: int | None = None

    def passes(self, stamp_ns: int) -> bool:
        """Whether the reading with this stamp is published."""
        distance_ns = stamp_ns - self._last_ns if self._last_ns is not None else 0
        self._last_ns = stamp_ns
        if self._due_ns is None or distance_ns < 0:  # the first one, or a reopened device
            self._due_ns = stamp_ns + self._period_ns
            return True
        tolerance_ns = min(distance_ns, self._period_ns) / 2
        if stamp_ns < self._due_ns - tolerance_ns:
            return False
        late = stamp_ns - self._due_ns > self._period_ns
        self._due_ns = (stamp_ns if late else self._due_ns) + self._period_ns
        return True

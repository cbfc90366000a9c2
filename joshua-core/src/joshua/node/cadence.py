"""Figures on how well timers and publishers hold their rates."""

from __future__ import annotations

from joshua.plan import TimerReport, TopicReport, TopicSpec

#: Buckets per power of two; more would be finer and larger.
SUB_BUCKET_BITS = 5
_SUB_BUCKETS = 1 << SUB_BUCKET_BITS

#: Durations from 2**42 ns (73 minutes) on share the last bucket.
_MAXIMUM_BITS = 42


class DurationHistogram:
    """Counts durations in logarithmic buckets.

    The scheme is that of HDR histograms: each power of two is divided into equal parts.
    """

    def __init__(self) -> None:
        self._counts = [0] * ((_MAXIMUM_BITS - SUB_BUCKET_BITS + 1) * _SUB_BUCKETS)
        self._total = 0
        self._maximum_ns = 0

    @property
    def count(self) -> int:
        """Durations so far."""
        return self._total

    @property
    def maximum_ns(self) -> int:
        """Longest duration so far, exactly; 0 for none."""
        return self._maximum_ns

    def add(self, duration_ns: int) -> None:
        """Counts one duration; a negative one counts as 0."""
        duration_ns = max(0, duration_ns)
        self._total += 1
        self._maximum_ns = max(self._maximum_ns, duration_ns)
        shift = duration_ns.bit_length() - SUB_BUCKET_BITS - 1
        index = duration_ns if shift <= 0 else shift * _SUB_BUCKETS + (duration_ns >> shift)
        self._counts[min(index, len(self._counts) - 1)] += 1

    def quantile_ns(self, fraction: float) -> int:
        """The duration that ``fraction`` (0 to 1) of all do not exceed; 0 when there are none."""
        wanted = fraction * self._total
        seen = 0
        for index, count in enumerate(self._counts):
            seen += count
            if count and seen >= wanted:
                return min(self._upper_ns(index), self._maximum_ns)
        return self._maximum_ns

    @staticmethod
    def _upper_ns(index: int) -> int:
        shift = max(0, index // _SUB_BUCKETS - 1)
        if shift == 0:
            return index
        return ((index - shift * _SUB_BUCKETS + 1) << shift) - 1


NS_PER_S = 1_000_000_000


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
    """Figures of one endpoint: running total, rate and, for a configured rate, deviation from it."""

    def __init__(self, topic: TopicSpec, *, is_publisher: bool) -> None:
        self._topic = topic
        self._is_publisher = is_publisher
        self._period_ns = round(NS_PER_S / topic.rate_hz) if topic.rate_hz > 0 else 0
        self._deviation = DurationHistogram()
        self._count = 0
        self._first_ns = 0
        self._last_ns = 0

    @property
    def name(self) -> str:
        """Name of the topic."""
        return self._topic.name

    @property
    def count(self) -> int:
        """Messages so far."""
        return self._count

    def add(self, now_ns: int) -> None:
        """Counts one message at ``now_ns`` of the monotonic clock."""
        if self._count == 0:
            self._first_ns = now_ns
        elif self._period_ns:
            self._deviation.add(abs(now_ns - self._last_ns - self._period_ns))
        self._last_ns = now_ns
        self._count += 1

    def report(self) -> TopicReport:
        """The figures so far."""
        return TopicReport(
            name=self._topic.name,
            type_name=self._topic.type_name,
            is_publisher=self._is_publisher,
            count=self._count,
            rate_hz=rate_hz(self._count, self._last_ns - self._first_ns),
            configured_hz=self._topic.rate_hz,
            jitter_p50_s=self._deviation.quantile_ns(0.50) / NS_PER_S,
            jitter_p99_s=self._deviation.quantile_ns(0.99) / NS_PER_S,
            jitter_p999_s=self._deviation.quantile_ns(0.999) / NS_PER_S,
        )


def rate_hz(count: int, length_ns: int) -> float:
    """Events per second from their number and the time between the first and the last."""
    return (count - 1) * NS_PER_S / length_ns if length_ns > 0 else 0.0

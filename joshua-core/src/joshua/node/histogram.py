"""A histogram of durations in bounded memory, with a relative error of about three per cent."""

from __future__ import annotations

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

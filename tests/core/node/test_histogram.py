"""Quantiles in bounded memory."""

from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from joshua.node.cadence import DurationHistogram


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

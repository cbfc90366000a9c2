"""Intervals and tests for figures of episodes, in plain Python; every random choice has a seed."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist, fmean


@dataclass(frozen=True)
class Estimate:
    """A figure and its confidence interval.

    Attributes:
        method: ``wilson`` for rates, ``bootstrap`` for means; count: episodes behind it.
    """

    value: float
    low: float
    high: float
    count: int
    method: str


@dataclass(frozen=True)
class Difference:
    """The second of two paired samples minus the first, with a two-sided test of equality.

    Attributes:
        better, worse: pairs in which the second is larger, and smaller.
        p_value: of McNemar's exact test for rates, of the bootstrap for means.
    """

    value: float
    low: float
    high: float
    count: int
    better: int
    worse: int
    p_value: float
    method: str


def wilson(successes: int, count: int, confidence: float = 0.95) -> Estimate:
    """Return a rate and its score interval (Wilson 1927), which stays within 0 and 1 for few episodes."""
    if not count:
        return Estimate(math.nan, 0.0, 1.0, 0, "wilson")
    z = NormalDist().inv_cdf(0.5 + confidence / 2)
    rate, weight = successes / count, z * z / count
    middle = (rate + weight / 2) / (1 + weight)
    half = z / (1 + weight) * math.sqrt(rate * (1 - rate) / count + weight / (4 * count))
    low = 0.0 if successes == 0 else max(0.0, middle - half)
    return Estimate(rate, low, 1.0 if successes == count else min(1.0, middle + half), count, "wilson")


def bootstrap(
    values: Sequence[float], confidence: float = 0.95, samples: int = 10_000, seed: int = 0
) -> Estimate:
    """Return a mean and its percentile interval from samples with replacement (Efron 1979)."""
    if not values:
        return Estimate(math.nan, math.nan, math.nan, 0, "bootstrap")
    low, high = _quantiles(_means(values, samples, seed), confidence)
    return Estimate(fmean(values), low, high, len(values), "bootstrap")


def mcnemar(first: Sequence[bool], second: Sequence[bool]) -> float:
    """Return the p-value of McNemar's exact test, two-sided, that two policies succeed equally often."""
    lost = sum(a and not b for a, b in zip(first, second, strict=True))
    won = sum(b and not a for a, b in zip(first, second, strict=True))
    count, least = lost + won, min(lost, won)
    tail: float = sum(math.comb(count, k) for k in range(least + 1)) / 2**count
    return min(1.0, 2 * tail)


def paired(
    first: Sequence[float],
    second: Sequence[float],
    *,
    rate: bool = False,
    confidence: float = 0.95,
    samples: int = 10_000,
    seed: int = 0,
) -> Difference:
    """Compare two policies episode by episode, both from the same starts.

    Args:
        first, second: of the same episodes in the same order; rate: whether values are 0 or 1.

    Raises:
        ValueError: their numbers differ.
    """
    if len(first) != len(second):
        raise ValueError(f"{len(first)} episodes and {len(second)} are not pairs")
    differences = [b - a for a, b in zip(first, second, strict=True)]
    if not differences:
        return Difference(math.nan, math.nan, math.nan, 0, 0, 0, 1.0, "none")
    means = _means(differences, samples, seed)
    low, high = _quantiles(means, confidence)
    if rate:
        p_value = mcnemar([bool(v) for v in first], [bool(v) for v in second])
    else:
        beyond = min(sum(mean <= 0 for mean in means), sum(mean >= 0 for mean in means))
        p_value = min(1.0, 2 * (beyond + 1) / (len(means) + 1))
    return Difference(
        fmean(differences),
        low,
        high,
        len(differences),
        sum(d > 0 for d in differences),
        sum(d < 0 for d in differences),
        p_value,
        "mcnemar" if rate else "bootstrap",
    )


def _means(values: Sequence[float], samples: int, seed: int) -> list[float]:
    generator = random.Random(seed)  # noqa: S311 (samples, not secrets)
    count = len(values)
    return sorted(fmean(generator.choices(values, k=count)) for _ in range(samples))


def _quantiles(ordered: Sequence[float], confidence: float) -> tuple[float, float]:
    """Return both ends of the middle share, interpolated between neighbours."""

    def at(share: float) -> float:
        place = share * (len(ordered) - 1)
        below = math.floor(place)
        above = min(below + 1, len(ordered) - 1)
        return ordered[below] + (ordered[above] - ordered[below]) * (place - below)

    return at((1 - confidence) / 2), at((1 + confidence) / 2)

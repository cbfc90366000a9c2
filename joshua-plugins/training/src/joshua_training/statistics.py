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
        value: None for no episode; low, high: None for the mean of fewer than two.
        method: ``wilson`` for rates, ``bootstrap`` for means; count: episodes behind it.
    """

    value: float | None
    low: float | None
    high: float | None
    count: int
    method: str


@dataclass(frozen=True)
class Difference:
    """The second of two paired samples minus the first, with a two-sided test of equality.

    Attributes:
        value: None for no pair.
        low, high: by Newcombe for rates, of the bootstrap for means; None for fewer than two pairs of means.
        better, worse: pairs in which the second is larger, and smaller.
        p_value: of McNemar's exact test for rates, of the bootstrap for means; None where there is no test.
    """

    value: float | None
    low: float | None
    high: float | None
    count: int
    better: int
    worse: int
    p_value: float | None
    method: str


def wilson(successes: int, count: int, confidence: float = 0.95) -> Estimate:
    """Return a rate and its score interval (Wilson 1927), which stays within 0 and 1 for few episodes."""
    if not count:
        return Estimate(None, 0.0, 1.0, 0, "wilson")
    low, high = _score(successes, count, confidence)
    return Estimate(successes / count, low, high, count, "wilson")


def _score(successes: int, count: int, confidence: float) -> tuple[float, float]:
    z = NormalDist().inv_cdf(0.5 + confidence / 2)
    rate, weight = successes / count, z * z / count
    middle = (rate + weight / 2) / (1 + weight)
    half = z / (1 + weight) * math.sqrt(rate * (1 - rate) / count + weight / (4 * count))
    low = 0.0 if successes == 0 else max(0.0, middle - half)
    return low, 1.0 if successes == count else min(1.0, middle + half)


def bootstrap(
    values: Sequence[float], confidence: float = 0.95, samples: int = 10_000, seed: int = 0
) -> Estimate:
    """Return a mean and its percentile interval from samples with replacement (Efron 1979).

    Every sample of one value is this value, so its spread is unknown and it has no interval.
    """
    if len(values) < 2:
        return Estimate(fmean(values) if values else None, None, None, len(values), "bootstrap")
    low, high = _quantiles(_means(values, samples, seed), confidence)
    return Estimate(fmean(values), low, high, len(values), "bootstrap")


def mcnemar(first: Sequence[bool], second: Sequence[bool]) -> float:
    """Return the p-value of McNemar's exact test, two-sided, that two policies succeed equally often."""
    lost = sum(a and not b for a, b in zip(first, second, strict=True))
    won = sum(b and not a for a, b in zip(first, second, strict=True))
    count, least = lost + won, min(lost, won)
    tail: float = sum(math.comb(count, k) for k in range(least + 1)) / 2**count
    return min(1.0, 2 * tail)


def newcombe(both: int, won: int, lost: int, neither: int, confidence: float = 0.95) -> tuple[float, float]:
    """Return the score interval of the difference of two paired rates, method 10 of Newcombe (1998).

    Unlike the bootstrap, it has a width if all pairs are alike.

    Args:
        both: pairs in which both succeed; won: only the second; lost: only the first; neither: none.
    """
    count = both + won + lost + neither
    second, first = (both + won) / count, (both + lost) / count
    low_2, high_2 = _score(both + won, count, confidence)
    low_1, high_1 = _score(both + lost, count, confidence)
    margins = (both + won) * (lost + neither) * (both + lost) * (won + neither)
    product = float(both * neither - won * lost)
    if product > 0:  # the correction for continuity
        product = max(product - count / 2, 0.0)
    phi = product / math.sqrt(margins) if margins else 0.0

    def distance(one: float, other: float) -> float:
        return math.sqrt(max(0.0, one * one - 2 * phi * one * other + other * other))

    change = second - first
    low = change - distance(second - low_2, high_1 - first)
    return max(-1.0, low), min(1.0, change + distance(high_2 - second, first - low_1))


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
        return Difference(None, None, None, 0, 0, 0, None, "none")
    better, worse = sum(d > 0 for d in differences), sum(d < 0 for d in differences)
    low: float | None = None
    high: float | None = None
    p_value: float | None = None
    if rate:
        both = sum(bool(a and b) for a, b in zip(first, second, strict=True))
        neither = len(differences) - both - better - worse
        low, high = newcombe(both, better, worse, neither, confidence)
        p_value = mcnemar([bool(v) for v in first], [bool(v) for v in second])
    elif len(differences) > 1:
        means = _means(differences, samples, seed)
        low, high = _quantiles(means, confidence)
        beyond = min(sum(mean <= 0 for mean in means), sum(mean >= 0 for mean in means))
        p_value = min(1.0, 2 * (beyond + 1) / (len(means) + 1))
    return Difference(
        fmean(differences),
        low,
        high,
        len(differences),
        better,
        worse,
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

"""Intervals and paired tests, against published values."""

from __future__ import annotations

import random

import pytest
from joshua_training.statistics import bootstrap, mcnemar, paired, wilson


def known(value: float | None) -> float:
    assert value is not None
    return value


@pytest.mark.parametrize(
    ("successes", "count", "low", "high"),
    [
        # Newcombe 1998, table I: 81/263, 15/148, 0/20, 1/29
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
        (20, 20, 0.8389, 1.0),
    ],
)
def test_the_interval_of_wilson_is_that_of_the_literature(
    successes: int, count: int, low: float, high: float
) -> None:
    found = wilson(successes, count)
    assert (found.low, found.high) == (pytest.approx(low, abs=1e-4), pytest.approx(high, abs=1e-4))
    assert found.value == successes / count
    assert known(wilson(successes, count, 0.99).low) <= known(found.low)


def test_no_episode_says_nothing_of_a_rate() -> None:
    found = wilson(0, 0)
    assert found.value is None
    assert (found.low, found.high) == (0.0, 1.0)


def test_the_bootstrap_covers_the_mean_as_often_as_it_says_and_repeats_by_its_seed() -> None:
    generator = random.Random(1)
    covered = 0
    for trial in range(200):
        values = [generator.gauss(3.0, 2.0) for _ in range(40)]
        found = bootstrap(values, 0.9, 300, trial)
        covered += known(found.low) <= 3.0 <= known(found.high)
    assert 165 <= covered <= 195  # 180 expected, five standard deviations are 21
    values = [1.0, 2.0, 4.0]
    assert bootstrap(values, seed=4) == bootstrap(values, seed=4)
    many = [float(number**2) for number in range(20)]
    assert bootstrap(many, seed=4).low != bootstrap(many, seed=5).low
    assert bootstrap([2.5, 2.5]).low == bootstrap([2.5, 2.5]).high == 2.5


def test_the_mean_of_one_episode_has_no_interval_and_its_difference_no_test() -> None:
    found = bootstrap([5.0])
    assert (found.value, found.low, found.high, found.count) == (5.0, None, None, 1)
    assert bootstrap([]).value is None
    change = paired([1.0], [4.0])
    assert (change.value, change.low, change.high, change.p_value) == (3.0, None, None, None)
    assert (change.better, change.count) == (1, 1)
    nothing = paired([], [], rate=True)
    assert (nothing.value, nothing.low, nothing.high, nothing.p_value) == (None, None, None, None)


@pytest.mark.parametrize(
    ("both", "second", "first", "neither", "low", "high"),
    [
        # Newcombe 1998 (paired data), table III, method 10
        (36, 12, 2, 0, 0.0569, 0.3404),
        (20, 12, 2, 16, 0.0562, 0.3292),
        (35, 14, 0, 1, 0.1461, 0.4175),
        (18, 14, 0, 18, 0.1441, 0.3963),
        (2, 97, 1, 0, 0.8721, 0.9854),
        (0, 29, 1, 0, 0.6666, 0.9882),
        (0, 30, 0, 0, 0.8395, 1.0),
        (54, 0, 0, 0, -0.0664, 0.0664),
        (53, 0, 0, 1, -0.0729, 0.0729),
        (27, 0, 0, 27, -0.0351, 0.0351),
    ],
)
def test_the_interval_of_two_rates_is_that_of_the_literature(
    both: int, second: int, first: int, neither: int, low: float, high: float
) -> None:
    ones = [1.0] * both + [0.0] * second + [1.0] * first + [0.0] * neither
    others = [1.0] * both + [1.0] * second + [0.0] * first + [0.0] * neither
    found = paired(ones, others, rate=True)
    assert (found.low, found.high) == (pytest.approx(low, abs=6e-5), pytest.approx(high, abs=6e-5))
    swapped = paired(others, ones, rate=True)
    assert swapped.low == pytest.approx(-high, abs=6e-5)
    assert known(paired(ones, others, rate=True, confidence=0.99).low) < known(found.low)


def test_mcnemar_counts_only_pairs_that_differ() -> None:
    first = [True] * 10 + [False] * 6 + [True, False]
    second = [True] * 10 + [True] * 6 + [False, False]
    assert mcnemar(first, second) == pytest.approx(2 * (1 + 7) / 2**7)  # 1 against 6
    assert mcnemar(first, first) == 1.0


def test_a_paired_difference_tells_more_than_two_means() -> None:
    generator = random.Random(2)
    first = [generator.gauss(0.0, 50.0) for _ in range(60)]
    second = [value + 1.0 + generator.gauss(0.0, 0.5) for value in first]
    found = paired(first, second, samples=2000)
    assert found.value == pytest.approx(1.0, abs=0.3)
    assert 0 < known(found.low) < known(found.value) < known(found.high)
    assert known(found.p_value) < 0.01
    assert found.better > 50
    alike = paired(first, first, samples=500)
    assert (alike.value, alike.better, alike.worse, alike.p_value) == (0.0, 0, 0, 1.0)
    rates = paired([0, 0, 0, 0, 0, 0], [1, 1, 1, 1, 1, 1], rate=True)
    assert (rates.method, rates.p_value) == ("mcnemar", 2 / 64)
    with pytest.raises(ValueError, match="are not pairs"):
        paired([1.0], [1.0, 2.0])

"""Numbers are read alike, whatever version of protobuf is installed."""

from __future__ import annotations

import math

import pytest
from joshua.textproto.literals import number


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("3.5F", 3.5),
        ("3.5f", 3.5),
        ("-0.5", -0.5),
        ("0", 0.0),
        ("5.", 5.0),
        ("-INF", -math.inf),
        ("1e400", math.inf),
    ],
)
def test_a_number_has_the_value_that_it_says(text: str, value: float) -> None:
    assert number(text) == value


@pytest.mark.parametrize("text", ["010", "-017", "00.5", "1.5x", ""])
def test_an_octal_or_broken_number_is_none(text: str) -> None:
    assert number(text) is None

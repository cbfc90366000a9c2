"""Ranges of a sweep."""

from __future__ import annotations

import pytest
from joshua_jobs.executor import JobError
from joshua_ray.spaces import Space, as_text, read


def test_ranges_and_fixed_values_are_told_apart() -> None:
    fixed, spaces = read(
        [
            "a.b=0.5",
            'a.name="choice"',
            "a.rate=loguniform(1e-4, 1e-2)",
            "a.size=choice(16,32)",
            "a.count=integer(1,3)",
            "a[0].kind=grid(A, B)",
            'a.widths=choice([64, 64], [128], "x,y")',
        ]
    )
    assert fixed == ["a.b=0.5", 'a.name="choice"']
    assert spaces == [
        Space("a.rate", "loguniform", ends=(1e-4, 1e-2)),
        Space("a.size", "choice", items=("16", "32")),
        Space("a.count", "integer", ends=(1.0, 3.0)),
        Space("a[0].kind", "grid", items=("A", "B")),
        Space("a.widths", "choice", items=("[64, 64]", "[128]", '"x,y"')),
    ]
    assert [space.extremes for space in spaces[:3]] == [("0.0001", "0.01"), ("16", "32"), ("1", "3")]
    assert [as_text(0.25), as_text(3), as_text("A")] == ["0.25", "3", "A"]


@pytest.mark.parametrize(
    ("override", "why"),
    [
        ("a=normal(0,1)", "there is no range normal"),
        ("a=uniform(1)", "it takes two numbers"),
        ("a=uniform(1,b)", "it takes two numbers"),
        ("a=uniform(2,1)", "its first number must be below its second"),
        ("a=uniform(0,nan)", "its first number must be below its second"),
        ("a=loguniform(0,1)", "a logarithmic range starts above 0"),
        ("a=integer(1,2.5)", "its ends are whole numbers"),
        ("a=choice()", "it has no value"),
    ],
)
def test_a_malformed_range_says_why_and_what_is_allowed(override: str, why: str) -> None:
    with pytest.raises(JobError) as caught:
        read([override])
    assert str(caught.value).startswith(f"--set {override}: {why}. Write uniform(0.9,0.999), loguniform(")
    assert caught.value.exit_code == 2


def test_a_sweep_without_a_range_is_refused() -> None:
    with pytest.raises(JobError, match="no field varies"):
        read(["a=1"])

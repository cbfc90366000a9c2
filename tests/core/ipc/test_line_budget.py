"""The limit of log lines."""

from __future__ import annotations

from joshua.ipc.line_budget import LineBudget


class Clock:
    now_s = 100.0

    def __call__(self):
        return self.now_s


def test_lines_above_the_limit_are_counted_until_lines_are_allowed_again():
    clock = Clock()
    budget = LineBudget(3, clock)

    assert [budget.take() for _ in range(5)] == [True] * 3 + [False] * 2
    assert budget.drop_if_exhausted(10)
    assert budget.settle() == 0
    clock.now_s += 1.0
    assert not budget.drop_if_exhausted(10)
    assert budget.settle() == 12
    assert budget.take()
    assert budget.settle() == 0


def test_a_flood_that_ends_is_told_all_the_same():
    clock = Clock()
    budget = LineBudget(1, clock)
    budget.take()
    budget.take()

    clock.now_s += 1.0
    assert budget.settle() == 1
    assert budget.settle() == 0
    budget.take()
    budget.take()
    assert budget.settle(ended=True) == 1

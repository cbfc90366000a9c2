"""Acquisition stamps."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from joshua.devices.stamps import StampClock


def test_stamps_never_run_backwards(monkeypatch: pytest.MonkeyPatch) -> None:
    monotonic = iter([100, 200, 300, 400, 400])
    wall = iter([1_100, 700, 800, 9_400, 9_400])  # set back by 500, then forward
    monkeypatch.setattr("joshua.devices.stamps.time.monotonic_ns", lambda: next(monotonic))
    monkeypatch.setattr("joshua.devices.stamps.time.time_ns", lambda: next(wall))
    clock = StampClock()
    assert [clock.now_ns() for _ in range(5)] == [1_100, 1_200, 1_300, 9_400, 9_401]


def test_a_process_that_is_held_up_between_two_clocks_stamps_nothing_in_the_future(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    true_ns = [0]
    held_ns = [0, 1_000_000_000, 0, 0, 0, 0]

    def clock_of(epoch_ns: int) -> Callable[[], int]:
        def read() -> int:
            shown_ns = true_ns[0] + epoch_ns
            true_ns[0] += 10 + held_ns.pop(0)
            return shown_ns

        return read

    monkeypatch.setattr("joshua.devices.stamps.time.monotonic_ns", clock_of(0))
    monkeypatch.setattr("joshua.devices.stamps.time.time_ns", clock_of(5_000_000_000_000))
    clock = StampClock()
    for _ in range(3):
        assert clock.now_ns() <= true_ns[0] + 5_000_000_000_000

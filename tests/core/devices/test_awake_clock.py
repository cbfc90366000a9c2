"""A clock that stands still while its process is held up."""

from __future__ import annotations

import pytest
from joshua.devices.awake_clock import LONGEST_LOOK_S, AwakeClock


def test_time_counts_while_somebody_looks_and_not_while_the_process_is_held_up() -> None:
    now = [100.0]
    clock = AwakeClock(lambda: now[0])
    assert clock.now_s() == 0.0
    for _ in range(50):
        now[0] += 0.02
        clock.now_s()
    assert clock.now_s() == pytest.approx(1.0)
    now[0] += 5.0  # nobody ran
    assert clock.now_s() == pytest.approx(1.0 + LONGEST_LOOK_S)
    now[0] += 0.1
    assert clock.now_s() == pytest.approx(1.1 + LONGEST_LOOK_S)

"""Times of bytes: those that came now, and those that had waited for a reader."""

from __future__ import annotations

import numpy as np
import pytest
from joshua_lidar.arrivals import Arrivals

MS = 1_000_000


def times_ms(arrivals: Arrivals, *ends: int) -> list[float]:
    return [float(time) / MS for time in arrivals.times_ns(np.array(ends, np.int64))]


def test_a_byte_came_as_long_before_as_those_behind_it_took() -> None:
    arrivals = Arrivals(100_000)  # 0.1 ms a byte
    arrivals.add(50, 20 * MS)
    arrivals.add(50, 40 * MS)
    assert times_ms(arrivals, 50, 60, 100) == [20.0, 36.0, 40.0]


def test_what_had_waited_came_at_the_usual_rate() -> None:
    arrivals = Arrivals(100_000)
    for piece in range(1, 61):  # half of what the line could carry
        arrivals.add(50, piece * 10 * MS)
    arrivals.add(500, 700 * MS)  # nobody read for 100 ms
    assert times_ms(arrivals, 3000, 3010, 3250, 3500) == pytest.approx([600, 602, 650, 700], abs=0.5)


def test_at_the_beginning_the_line_speed_is_all_that_is_known() -> None:
    arrivals = Arrivals(100_000)
    arrivals.add(500, 100 * MS)
    assert times_ms(arrivals, 100, 500) == [60.0, 100.0]


def test_each_packet_of_a_piece_has_its_time_though_there_were_pauses_between_them() -> None:
    arrivals = Arrivals(100_000)
    for piece in range(1, 101):  # two packets of 25 bytes each 20 ms; 2.5 ms long, with pauses of 7.5 ms
        arrivals.add(50, piece * 20 * MS)
    assert times_ms(arrivals, 4950, 4975, 5000) == pytest.approx([1980, 1990, 2000], abs=0.5)


def test_a_sender_that_paused_does_not_seem_slow_afterwards() -> None:
    arrivals = Arrivals(100_000)
    for piece in range(1, 101):
        arrivals.add(50, piece * 10 * MS)
    for piece in range(101, 251):
        arrivals.add(50, piece * 10 * MS + 3000 * MS)  # its rotor stood still for three seconds
    assert times_ms(arrivals, 12450, 12500) == pytest.approx([5490, 5500], abs=0.5)

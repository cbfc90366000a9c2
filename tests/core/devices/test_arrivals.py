"""A control cycle in phase with its commands: simulated on a clock that moves from event to event."""

from __future__ import annotations

import random
from itertools import pairwise
from statistics import median, quantiles
from typing import Any

import pytest
from joshua.devices import arrivals as module
from joshua.devices.arrivals import Arrivals

MS = 1_000_000
READ_NS, WRITE_NS = 2 * MS, 1 * MS


class Simulation:
    """One follower whose cycle takes its bus time, and commands at given times; stands in for its clock."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, period_ms: float, arrivals_ns: list[int]) -> None:
        self.now_ns = 0
        self._coming = sorted(arrivals_ns)
        self._newest: int | None = None
        self._period_ns = round(period_ms * MS)
        self.arrivals = Arrivals(period_ms / 1e3)
        self.latencies_ms: list[float] = []
        self.begins_ns: list[int] = []
        monkeypatch.setattr(module, "time", self)
        monkeypatch.setattr(self.arrivals, "_condition", self)

    def monotonic_ns(self) -> int:
        return self.now_ns

    def __enter__(self) -> None:
        return None

    def __exit__(self, *_: Any) -> None:
        return None

    def notify_all(self) -> None:
        return None

    def wait(self, timeout_s: float) -> None:
        """Of the condition: until the next command comes, at most for a time."""
        until_ns = self.now_ns + max(1, round(timeout_s * 1e9))
        self.advance(min(until_ns, self._coming[0]) if self._coming else until_ns)

    def advance(self, to_ns: int) -> None:
        while self._coming and self._coming[0] <= to_ns:
            self.now_ns = max(self.now_ns, self._coming.pop(0))
            self._newest = self.now_ns
            self.arrivals.arrived(self.now_ns)
        self.now_ns = max(self.now_ns, to_ns)

    def run(self, seconds: float, start_ms: float = 0.0, read_ns: int = READ_NS) -> None:
        deadline_ns = round(start_ms * MS)
        while self.now_ns < seconds * 1e9:
            self.advance(deadline_ns)
            self.begins_ns.append(self.now_ns)
            deadline_ns += self._period_ns
            self.arrivals.begin()
            self.advance(self.now_ns + read_ns)
            self.arrivals.wait()
            if self._newest is not None:
                self.latencies_ms.append((self.now_ns - self._newest) / MS)
                self._newest = None
            self.advance(self.now_ns + WRITE_NS)
            self.next_ns = deadline_ns
            self.arrivals.end(self)  # type: ignore[arg-type]
            deadline_ns = max(self.next_ns, self.now_ns)

    def schedule(self, deadline_ns: int) -> None:
        """Of the timer."""
        self.next_ns = deadline_ns

    @property
    def rate_hz(self) -> float:
        return (len(self.begins_ns) - 1) * 1e9 / (self.begins_ns[-1] - self.begins_ns[0])


def regular(period_ms: float, seconds: float, jitter_ms: float = 0.0, offset_ms: float = 7.3) -> list[int]:
    """Commands at a rate, each late by a random time that is often small and sometimes large."""
    generator = random.Random(1)
    count = round(seconds * 1e3 / period_ms)
    late = [generator.expovariate(1 / jitter_ms) if jitter_ms else 0.0 for _ in range(count)]
    return [round((offset_ms + k * period_ms + late[k]) * MS) for k in range(count)]


@pytest.mark.parametrize("period_ms", [20.0, 10.0, 5.0])
@pytest.mark.parametrize("offset_ms", [0.1, 1.9, 3.0, 4.9])
def test_a_regular_command_is_written_as_it_arrives(
    period_ms: float, offset_ms: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    loop = Simulation(monkeypatch, period_ms, regular(period_ms, 5.0, offset_ms=offset_ms))
    loop.run(5.0)
    assert max(loop.latencies_ms[20:]) < 0.1
    assert loop.rate_hz == pytest.approx(1e3 / period_ms, rel=0.01)


def test_a_reading_may_take_more_than_half_of_the_period(monkeypatch: pytest.MonkeyPatch) -> None:
    """Six servos at 200 Hz: the reading would still run when the command comes."""
    loop = Simulation(monkeypatch, 5.0, regular(5.0, 5.0))
    loop.run(5.0, read_ns=3 * MS)
    assert max(loop.latencies_ms[20:]) < 0.1
    assert loop.rate_hz == pytest.approx(200.0, rel=0.01)


@pytest.mark.parametrize(
    ("period_ms", "jitter_ms", "p90_ms"),
    [(20.0, 0.5, 0.5), (20.0, 2.0, 2.0), (10.0, 2.0, 2.0), (5.0, 0.5, 0.5), (5.0, 1.0, 1.0)],
)
def test_jitter_of_the_commands_costs_little(
    period_ms: float, jitter_ms: float, p90_ms: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    loop = Simulation(monkeypatch, period_ms, regular(period_ms, 20.0, jitter_ms))
    loop.run(20.0)
    settled = loop.latencies_ms[100:]
    assert median(settled) < 0.2
    assert quantiles(settled, n=10)[8] < p90_ms
    assert loop.rate_hz == pytest.approx(1e3 / period_ms, rel=0.01)


@pytest.mark.parametrize("times", [2, 4])
def test_a_faster_commander_is_followed_at_the_own_rate(times: int, monkeypatch: pytest.MonkeyPatch) -> None:
    loop = Simulation(monkeypatch, 20.0, regular(20.0 / times, 5.0))
    loop.run(5.0)
    assert max(loop.latencies_ms[20:]) < 0.1
    assert loop.rate_hz == pytest.approx(50, rel=0.01)


@pytest.mark.parametrize("command_hz", [10.0, 30.0, 42.0, 70.0])
def test_at_another_rate_the_cycle_keeps_its_own_clock(
    command_hz: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    loop = Simulation(monkeypatch, 20.0, regular(1e3 / command_hz, 5.0))
    loop.run(5.0)
    assert loop.rate_hz == pytest.approx(50, rel=0.01)


def test_a_cycle_whose_commands_stop_goes_on_and_finds_the_phase_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    commands = [*regular(20.0, 2.0), *(at + 4_000 * MS for at in regular(20.0, 2.0, offset_ms=13.1))]
    loop = Simulation(monkeypatch, 20.0, commands)
    loop.run(6.0)
    assert loop.rate_hz == pytest.approx(50, rel=0.02)
    gaps_ms = [(b - a) / MS for a, b in pairwise(loop.begins_ns)]
    assert max(gaps_ms) < 31, "no cycle waits for a command for longer than half a period"
    assert max(loop.latencies_ms[-60:]) < 0.1

"""A control cycle in phase with its commands: simulated on a clock that moves from event to event."""

from __future__ import annotations

import random
from collections.abc import Iterable
from itertools import pairwise
from statistics import median, quantiles
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from joshua.devices import arrivals as module
from joshua.devices.arrivals import Arrivals
from joshua.node.timers import Timer

MS = 1_000_000
READ_NS, WRITE_NS = 2 * MS, 1 * MS


class Simulation:
    """One follower whose cycle takes its bus time, and commands at given times; stands in for its clock.

    Stalls delay the cycle and the commands alike, as they do where the machine is busy: what arrives
    meanwhile is delivered at the end. Each has a time and a length in nanoseconds.
    """

    def __init__(
        self,
        monkeypatch: pytest.MonkeyPatch,
        period_ms: float,
        arrivals_ns: list[int],
        stalls_ns: Iterable[tuple[int, int]] = (),
    ) -> None:
        self.now_ns = 0
        self._coming = sorted(arrivals_ns)
        self._stalls = sorted(stalls_ns)
        self._newest: int | None = None
        self.arrivals = Arrivals(period_ms / 1e3)
        self.timer = Timer(period_ms / 1e3, self._cycle, "control")
        self._read_ns = READ_NS
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
        while self._stalls and self._stalls[0][0] <= to_ns:
            begins_ns, length_ns = self._stalls.pop(0)
            self._deliver(begins_ns)
            self.now_ns = max(self.now_ns, begins_ns) + length_ns
        self._deliver(to_ns)
        self.now_ns = max(self.now_ns, to_ns)

    def _deliver(self, until_ns: int) -> None:
        while self._coming and self._coming[0] <= max(until_ns, self.now_ns):
            self.now_ns = max(self.now_ns, self._coming.pop(0))
            self._newest = self.now_ns
            self.arrivals.arrived(self.now_ns)

    def run(self, seconds: float, start_ms: float = 0.0, read_ns: int = READ_NS) -> None:
        self._read_ns = read_ns
        self.now_ns = round(start_ms * MS)
        self.timer.start(self.now_ns)
        while self.now_ns < seconds * 1e9:
            self.advance(self.timer.due_ns)
            self.timer.run_if_due(self.now_ns)

    def _cycle(self) -> None:
        self.begins_ns.append(self.now_ns)
        self.arrivals.begin()
        self.advance(self.now_ns + self._read_ns)
        self.arrivals.wait()
        if self._newest is not None:
            self.latencies_ms.append((self.now_ns - self._newest) / MS)
            self._newest = None
        self.advance(self.now_ns + WRITE_NS)
        self.arrivals.end(self.timer)

    @property
    def rate_hz(self) -> float:
        return (len(self.begins_ns) - 1) * 1e9 / (self.begins_ns[-1] - self.begins_ns[0])

    @property
    def overruns(self) -> int:
        return self.timer.cadence.report().overruns


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
    loop = Simulation(monkeypatch, 20.0, regular(20.0 / times, 6.0))
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


def test_a_stall_is_counted_once_and_the_next_command_is_followed(monkeypatch: pytest.MonkeyPatch) -> None:
    loop = Simulation(monkeypatch, 10.0, regular(10.0, 5.0), [(2_000 * MS, 200 * MS)])
    loop.run(5.0)
    assert loop.overruns in (19, 20)
    gaps_ms = [(b - a) / MS for a, b in pairwise(loop.begins_ns)]
    assert min(gaps_ms[20:]) >= 5.0
    assert sorted(gaps_ms)[-1] == pytest.approx(200.0, abs=15.0)
    assert sorted(gaps_ms)[-2] < 15.0
    assert max(loop.latencies_ms[-270:]) < 0.1


def test_short_stalls_cause_no_cycles_in_quick_succession(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without commands the cycle keeps its own clock; the stalls are longer than half of a period."""
    stalls = [(at * MS, 6 * MS) for at in range(100, 4_000, 37)]
    loop = Simulation(monkeypatch, 10.0, [], stalls)
    loop.run(5.0)
    gaps_ms = [(b - a) / MS for a, b in pairwise(loop.begins_ns)]
    assert min(gaps_ms) >= 5.0
    assert len(loop.begins_ns) + loop.overruns == pytest.approx(500, abs=2)


#: Stalls as their distance from the one before, and their length, in periods.
STALLS = st.lists(st.tuples(st.floats(0.1, 60.0), st.floats(0.05, 30.0)), max_size=6)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(
    period_ms=st.sampled_from([20.0, 10.0, 5.0]),
    times=st.sampled_from([1, 1, 2, 4]),
    off_rate=st.floats(-0.004, 0.004),
    offset=st.floats(0.0, 1.0),
    jitter=st.floats(0.0, 0.04),
    lost=st.floats(0.0, 0.2),
    stalls=STALLS,
    seed=st.integers(0, 1_000),
)
def test_whatever_happens_cycles_keep_their_distance_and_settle(
    period_ms: float,
    times: int,
    off_rate: float,
    offset: float,
    jitter: float,
    lost: float,
    stalls: list[tuple[float, float]],
    seed: int,
) -> None:
    """Commands at the rate of the cycle or a multiple, late, lost, and delayed by stalls of the machine.

    Args:
        off_rate: share by which the commander's clock runs slow; offset: of its first command, in periods.
        jitter: mean delay of a command, as a share of the period; lost: share of the commands that are lost.
    """
    generator = random.Random(seed)
    at_ns = 0.0
    stalls_ns = []
    for distance, length in stalls:
        at_ns += distance * period_ms * MS
        stalls_ns.append((round(at_ns), round(length * period_ms * MS)))
        at_ns += length * period_ms * MS
    quiet_from_ns = at_ns
    seconds = quiet_from_ns / 1e9 + 80 * period_ms / 1e3
    interval_ms = period_ms / times * (1 + off_rate)
    on_time = regular(interval_ms, seconds, offset_ms=offset * period_ms)
    delays_ns = [min(generator.expovariate(1.0) * jitter, 0.2) * period_ms * MS / times for _ in on_time]
    is_settled_ns = quiet_from_ns + 20 * period_ms * MS
    commands = [
        round(due + delay)
        for due, delay in zip(on_time, delays_ns, strict=True)
        if due > is_settled_ns - 10 * period_ms * MS or generator.random() >= lost
    ]
    with pytest.MonkeyPatch.context() as patch:
        loop = Simulation(patch, period_ms, commands, stalls_ns)
        loop.run(seconds)
    gaps_ns = [later - earlier for earlier, later in pairwise(loop.begins_ns)]
    assert min(gaps_ns) >= period_ms * MS / 2 - 1
    passed = loop.begins_ns[-1] / (period_ms * MS)
    # A change of the phase moves the cycles by up to half a period after each stall and at the first command.
    assert abs(len(loop.begins_ns) + loop.overruns - passed) <= 1 + len(stalls) / 2 + 0.004 * passed
    settled = [gap for begin, gap in zip(loop.begins_ns, gaps_ns, strict=False) if begin > is_settled_ns]
    assert max(abs(gap - period_ms * MS) for gap in settled) < 0.2 * period_ms * MS

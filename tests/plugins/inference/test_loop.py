"""The loop in stepped time: what is played when, what a chunk is asked to continue, and what is counted."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from joshua.api import FloatArray, JointSpace, Model, Observation
from joshua.api.models import ChunkRequest, Execution
from joshua_inference.loop import InferenceLoop

RATE_HZ = 20.0
PERIOD_NS = round(1e9 / RATE_HZ)
START_NS = 1_000_000_000_000
JOINTS = JointSpace(("a", "b"), np.full(2, -2.0), np.full(2, 2.0))


class Scripted(Model):
    """Answers with ``chunk`` after ``late`` periods of the loop; keeps what it was asked to continue."""

    def __init__(self, machine: Machine) -> None:
        super().__init__(None, JOINTS)
        self.machine, self.chunk, self.late = machine, np.zeros((10, 2)), 0
        self.requests: list[ChunkRequest] = []

    load = reset = close = lambda self: None

    def act(self, observation: Observation) -> FloatArray:
        chunk = self.chunk
        self.machine.play(self.late)
        return chunk

    def continue_chunk(self, observation: Observation, request: ChunkRequest) -> FloatArray:
        self.requests.append(request)
        return self.act(observation)


class Machine:
    """A loop with its clock; ``played`` holds what each period published."""

    def __init__(self, **execution: Any) -> None:
        self.clock_ns = START_NS
        self.played: list[FloatArray | None] = []
        self.loop = InferenceLoop(Execution(**execution), JOINTS, 1 / RATE_HZ, lambda: self.clock_ns)
        self.model = Scripted(self)

    def play(self, periods: int, *, each_ns: int = PERIOD_NS) -> None:
        for _ in range(periods):
            self.played.append(self.loop.tick(runs=True, keep=True))
            self.clock_ns += each_ns

    def predict(self, chunk: FloatArray, *, late: int = 0) -> None:
        self.model.chunk, self.model.late = chunk, late
        self.loop.predict(self.model, Observation(self.clock_ns))

    def path(self) -> list[float]:
        """Of the first joint."""
        return [float(action[0]) for action in self.played if action is not None]


def line(steps: int, begin: float = 0.0, step: float = 0.01) -> FloatArray:
    """A chunk that moves both joints at one speed."""
    return np.repeat(begin + step * np.arange(steps)[:, None], 2, axis=1)


def test_a_chunk_that_does_not_arrive_ends_in_a_hold_by_a_ramp() -> None:
    machine = Machine(ramp_s=0.25)
    machine.predict(line(10))
    machine.play(10 + 5 + 5)  # the chunk, the ramp, and on
    path = machine.path()
    assert path[:10] == pytest.approx(0.01 * np.arange(10))
    steps = np.diff(path[9:])
    assert steps[:5] == pytest.approx(0.01 * (1 - np.arange(1, 6) / 5) ** 2), "ever slower"
    assert np.all(steps[4:] == 0), "and then a hold, which is published"
    found = machine.loop.figures()
    assert (found.periods, found.gaps, found.queue) == (20, 10, 0)
    machine.predict(line(20, begin=1.0))
    machine.play(10)
    back = np.diff(machine.path()[19:])
    assert np.all(back >= 0)
    assert back.max() < 0.4, "back by a ramp, too"


def test_joints_far_outside_their_limits_are_kept_with_their_first_position() -> None:
    machine = Machine()
    machine.predict(np.array([[2.05, 0.0], [0.0, 0.0]]))
    assert machine.loop.outside == {}, "a trained model misses a limit by 0.05 rad"
    machine.clock_ns += PERIOD_NS
    machine.play(1)
    machine.predict(np.array([[0.0, 3.0], [0.0, 1e300]]))
    machine.play(1)
    machine.predict(np.array([[-9.0, 7.0]]))
    assert machine.loop.outside == {"a": -9.0, "b": 1e300}


def test_late_steps_are_skipped_and_what_is_left_is_the_queue() -> None:
    machine = Machine()
    machine.predict(line(10), late=3)
    assert machine.loop.figures().skipped == 3
    machine.play(2)
    assert machine.path() == pytest.approx([0.03, 0.04])
    assert machine.loop.figures().queue == 5


def test_the_rate_is_that_of_the_actions_that_were_published() -> None:
    machine = Machine()
    machine.predict(line(100))
    machine.play(41)
    assert machine.loop.figures().rate_hz == pytest.approx(RATE_HZ)
    slow = Machine()
    slow.predict(line(100))
    slow.play(41, each_ns=2 * PERIOD_NS)  # each timer tick comes a period late
    assert slow.loop.figures().rate_hz == pytest.approx(RATE_HZ / 2)
    gaps = Machine()
    gaps.predict(line(20))
    gaps.play(40)
    assert gaps.loop.figures().rate_hz == pytest.approx(RATE_HZ / 2, rel=0.05)


def test_the_age_is_that_of_the_observation_and_the_reaction_that_of_the_first_action() -> None:
    machine = Machine()
    for _ in range(3):
        machine.predict(line(20), late=4)
        machine.play(4)
    found = machine.loop.figures()
    assert found.reaction_p50_s == pytest.approx(4 / RATE_HZ, rel=0.02)
    assert found.reaction_p99_s == pytest.approx(4 / RATE_HZ, rel=0.02)
    assert found.age_p50_s > found.reaction_p50_s
    assert found.age_p99_s == pytest.approx(11 / RATE_HZ, rel=0.02)


def test_the_border_is_counted_in_rad_and_in_rad_per_second() -> None:
    machine = Machine()
    machine.predict(line(20))
    machine.play(10)
    machine.predict(line(20, begin=0.1 + 0.3))  # 0.3 rad from where the plan goes on
    machine.play(2)
    found = machine.loop.figures()
    assert found.borders == 1
    assert found.border_rad == pytest.approx(0.3)
    assert found.border_rad_s == pytest.approx(0.3 * RATE_HZ)
    assert "border 0.3 rad 6 rad/s" in str(found)


def test_model_times_are_reported_by_their_median_and_99th_percentile(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    machine = Machine()
    passed_ns = 0
    monkeypatch.setattr("joshua_inference.loop.time.monotonic_ns", lambda: passed_ns)

    def act(observation: Observation) -> FloatArray:
        nonlocal passed_ns
        passed_ns += 50_000_000 if machine.loop.figures().chunks < 97 else 400_000_000
        return line(20)

    monkeypatch.setattr(machine.model, "act", act)
    for _ in range(100):
        machine.loop.predict(machine.model, Observation(machine.clock_ns))
        machine.play(1)
    found = machine.loop.figures()
    assert found.latency_p50_s == pytest.approx(0.05, rel=0.02)
    assert found.latency_p99_s == pytest.approx(0.4, rel=0.02)
    assert "model 50" in str(found)


def test_the_delay_is_the_longest_measured_one_and_the_horizon_what_is_left_of_the_plan() -> None:
    machine = Machine(strategy="REAL_TIME_CHUNKING")
    machine.predict(line(40), late=2)
    assert not machine.model.requests, "there is nothing to continue yet"
    for late in (5, 3, 3):
        machine.predict(line(40), late=late)
        machine.play(4)
    assert [request.delay for request in machine.model.requests] == [3, 6, 6], "a margin of one step"
    # of each plan of 40 steps, those are left that the arm has not carried out when the observation is taken
    assert [len(request.planned) for request in machine.model.requests] == [38, 31, 33]
    assert [request.overlap for request in machine.model.requests] == [38, 31, 33]
    for _ in range(11):
        machine.predict(line(40), late=1)
        machine.play(1)
    assert machine.model.requests[-1].delay == 2, "only the last ten count"


@pytest.mark.parametrize(("late", "after"), [(5, 20), (25, 25)], ids=["half", "at once"])
def test_the_next_chunk_is_asked_for_in_time_for_the_measured_delay(late: int, after: int) -> None:
    machine = Machine(strategy="REAL_TIME_CHUNKING")
    machine.predict(line(40), late=late)
    while not machine.loop.wait(0.0):
        machine.play(1)
    assert len(machine.played) == after


def test_what_was_asked_before_a_take_over_is_not_played() -> None:
    machine = Machine()
    machine.predict(line(20))
    machine.play(3)
    act = machine.model.act

    def taken_over(observation: Observation) -> FloatArray:
        machine.loop.clear(output=True)
        return act(observation)

    machine.model.act = taken_over  # type: ignore[method-assign]
    machine.predict(line(20, begin=1.0))
    machine.play(1)
    assert machine.played[-1] is None


def test_a_model_that_was_asked_before_a_pause_is_not_called_in_it() -> None:
    machine = Machine()
    machine.predict(line(10))
    machine.play(6)
    before = machine.loop.figures().chunks
    machine.loop.pause()
    machine.predict(line(10))  # the model's thread had been woken before
    assert machine.loop.figures().chunks == before
    machine.loop.resume()
    machine.predict(line(10))
    assert machine.loop.figures().chunks == before + 1

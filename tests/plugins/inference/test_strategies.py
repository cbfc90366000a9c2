from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from joshua.api.models import Execution
from joshua_inference.strategies import STRATEGIES, Chunk, Ensemble, Output, RealTimeChunking, Strategy

#: Chunks that arrive: first step, length, and how many steps after its first one it comes.
ARRIVALS = st.lists(
    st.tuples(st.integers(0, 60), st.integers(1, 20), st.integers(0, 25)), min_size=1, max_size=12
)


def number(action: npt.NDArray[np.float64] | None) -> float:
    assert action is not None
    return float(action[0])


def counted(first: int, length: int, joints: int = 1) -> Chunk:
    """A chunk whose actions are the numbers of their steps."""
    return Chunk(first, np.repeat(np.arange(first, first + length, dtype=float)[:, None], joints, axis=1))


@pytest.mark.parametrize("name", STRATEGIES)
@given(arrivals=ARRIVALS)
def test_no_step_is_played_at_another_time_than_its_own(name: str, arrivals: list[tuple[int, int, int]]):
    strategy = STRATEGIES[name](Execution(strategy=name))
    by_step: dict[int, list[Chunk]] = {}
    for first, length, after in arrivals:
        by_step.setdefault(first + after, []).append(counted(first, length))
    for step in range(100):
        for chunk in by_step.get(step, ()):
            strategy.add(chunk, step)
        due = strategy.due(step)
        assert due is None or due[0] == pytest.approx(step)


def test_a_new_chunk_replaces_what_is_left_of_the_one_before():
    strategy = Strategy(Execution())
    assert strategy.wants(0, 1)
    strategy.add(Chunk(0, np.zeros((10, 1))), 0)
    assert [strategy.wants(step, 2) for step in (4, 5, 6)] == [False, True, True], "at the half"
    assert strategy.wants(1, 9), "earlier, where the model takes long"
    strategy.add(Chunk(3, np.ones((4, 1))), 5)
    assert [None if (due := strategy.due(step)) is None else due[0] for step in (5, 6, 7)] == [1, 1, None]
    strategy.add(Chunk(0, np.full((5, 1), 9.0)), 6)
    assert strategy.due(6) == [1.0], "one that has passed is dropped"
    assert Strategy(Execution(steps_per_chunk=3)).execution.steps_per_chunk == 3


@given(
    coefficient=st.floats(-2, 2),
    rows=st.lists(st.floats(-3, 3), min_size=1, max_size=30),
)
def test_the_weights_of_an_ensemble_are_those_of_the_paper(coefficient: float, rows: list[float]):
    # Zhao et al. 2023, section 4.2: w_i = exp(-m * i), w_0 that of the oldest action
    ensemble = Ensemble(Execution(ensemble_coefficient=coefficient))
    step = len(rows)
    for first, value in enumerate(rows):
        ensemble.add(Chunk(first, np.full((step + 1, 1), value)), first)
    weights = np.exp(-coefficient * np.arange(len(rows)))
    assert number(ensemble.due(step)) == pytest.approx((weights * rows).sum() / weights.sum())


def test_a_chunk_in_real_time_continues_what_is_planned():
    strategy = RealTimeChunking(Execution(execution_horizon=4, guidance_schedule="GUIDANCE_LINEAR"))
    assert strategy.request(0, 3) is None, "nothing is planned yet"
    strategy.add(counted(0, 10), 0)
    request = strategy.request(4, 2)
    assert request is not None
    assert request.planned[:, 0].tolist() == [4, 5, 6, 7, 8, 9]
    assert (request.delay, request.overlap, request.schedule) == (2, 4, "linear")
    late = strategy.request(8, 5)
    assert late is not None
    assert (late.delay, late.overlap) == (2, 2), "no more is planned"
    assert strategy.request(10, 1) is None


def test_a_synchronous_chunk_is_carried_out_before_the_next_is_wanted():
    strategy = STRATEGIES["SYNCHRONOUS"](Execution(strategy="SYNCHRONOUS", steps_per_chunk=3))
    strategy.add(counted(5, 10), 5)
    assert [strategy.wants(step, 9) for step in (5, 6, 7, 8)] == [False, False, False, True]


@given(
    dues=st.lists(st.one_of(st.none(), st.floats(-2, 2)), min_size=1, max_size=80),
    limit=st.floats(0.1, 20),
    ramp_s=st.floats(0, 1),
    keep=st.booleans(),
)
def test_no_published_action_is_faster_than_the_limit(
    dues: list[float | None], limit: float, ramp_s: float, keep: bool
):
    output = Output(0.02, Execution(max_velocity_rad_s=limit, ramp_s=ramp_s))
    last: np.ndarray | None = None
    for due in dues:
        action = output.next(None if due is None else np.array([due]), keep=keep)
        if action is not None and last is not None:
            assert abs(action - last) <= limit * 0.02 + 1e-12
        last = action


def test_a_missing_action_ends_in_a_hold_by_a_ramp():
    output = Output(0.1, Execution(ramp_s=0.5))
    for value in (0.0, 0.1, 0.2):
        output.next(np.array([value]))
    path = [number(output.next(None)) for _ in range(8)]
    steps = np.diff([0.2, *path])
    assert steps[:5] == pytest.approx([0.064, 0.036, 0.016, 0.004, 0.0]), "(1 - t)^2 of the speed before"
    assert path[-1] == path[4], "a hold"
    back = [number(output.next(np.array([1.0]))) for _ in range(7)]
    assert np.all(np.diff([path[-1], *back]) >= 0)
    assert max(np.diff([path[-1], *back])) < 0.3
    assert back[5] == 1.0, "over at most the length of the ramp"


def test_without_a_hold_nothing_is_published_after_the_ramp():
    output = Output(0.1, Execution(ramp_s=0.2))
    output.next(np.array([0.5]))
    found = [output.next(None, keep=False) for _ in range(3)]
    assert [None if action is None else float(action[0]) for action in found] == [0.5, 0.5, None]
    assert output.next(np.array([-1.0])) == [-1.0], "the actuator itself approaches it"


def test_the_speed_into_a_ramp_is_not_that_of_a_border():
    output = Output(0.1, Execution(ramp_s=0.5))
    output.next(np.array([0.0]))
    output.next(np.array([0.01]))
    output.next(np.array([1.0]), border=True)
    assert number(output.next(None)) == pytest.approx(1.0 + 0.01 * 0.64)


@given(dues=st.lists(st.floats(-2, 2), min_size=1, max_size=20))
def test_an_action_within_the_limit_is_published_as_it_is(dues: list[float]):
    output = Output(0.02, Execution())
    assert [number(output.next(np.array([due]))) for due in dues] == dues

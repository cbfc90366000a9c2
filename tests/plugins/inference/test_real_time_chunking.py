"""Chunks that arrive 0.3 s late: a flow policy drives the simulated arm past a bar, by the real loop."""

from __future__ import annotations

import numpy as np
import pytest
from joshua.api import Observation
from joshua.api.models import ChunkRequest
from joshua.features import STATE
from reach_flow import COSINES, GOAL, PERIOD_NS, RATE_HZ, STEPS, ReachFlow, Run, Scene, drive

WAYS = 6


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene()


def ways(scene: Scene, strategy: str) -> list[Run]:
    return [drive(strategy, seed=seed, scene=scene) for seed in range(WAYS)]


def test_real_time_chunking_halves_the_jumps_at_borders_and_succeeds_as_often(scene: Scene) -> None:
    replacing, continuing = ways(scene, "REPLACE_ON_ARRIVAL"), ways(scene, "REAL_TIME_CHUNKING")
    for figure in ("border_mean_rad", "border_rad_s"):
        jumps, continued = (
            np.mean([getattr(way.figures, figure) for way in some]) for some in (replacing, continuing)
        )
        assert continued < 0.5 * jumps, (figure, continued, jumps)
    assert sum(way.passed for way in continuing) >= sum(way.passed for way in replacing)
    assert all(way.figures.borders >= 2 and not way.figures.gaps for way in continuing)


def test_late_steps_are_skipped_and_the_age_is_that_of_the_observation(scene: Scene) -> None:
    way = drive("REPLACE_ON_ARRIVAL", seed=1, scene=scene)
    assert way.figures.skipped == 8 * way.figures.chunks, "0.3 s are 7.5 periods"
    assert way.figures.reaction_p50_s == pytest.approx(0.32, rel=0.02)
    assert way.figures.age_p50_s > 0.32


def test_a_synchronous_arm_holds_while_the_model_computes(scene: Scene) -> None:
    way = drive("SYNCHRONOUS", seed=1, scene=scene)
    assert way.figures.skipped == 0
    assert way.figures.gaps > 0


def test_no_command_is_faster_than_the_limit(scene: Scene) -> None:
    way = drive("REPLACE_ON_ARRIVAL", seed=3, scene=scene, max_velocity_rad_s=0.4)
    steps = np.abs(np.diff(way.commands[20:], axis=0)).max()
    assert steps <= 0.4 / RATE_HZ + 1e-9
    free = drive("REPLACE_ON_ARRIVAL", seed=3, scene=scene)
    assert np.abs(np.diff(free.commands[20:], axis=0)).max() > 0.4 / RATE_HZ


def test_the_policy_keeps_what_is_fixed(scene: Scene) -> None:
    scene.reset(5)
    observation = Observation(PERIOD_NS, {STATE: scene.joints, GOAL: scene.goal_m})
    planned = ReachFlow(1).act(observation)
    free = ReachFlow(2).act(observation)
    continued = ReachFlow(2).continue_chunk(observation, ChunkRequest(planned, 9, 20))
    assert planned.shape == continued.shape == (STEPS, 6)
    assert np.abs(continued - planned)[:9].mean() < 0.5 * np.abs(free - planned)[:9].mean()


def test_the_derivative_of_the_network_is_that_of_its_velocity() -> None:
    network, draw = ReachFlow()._network, np.random.default_rng(0)
    entry, row = draw.normal(size=COSINES * 6 + 9 + 8), draw.normal(size=COSINES * 6)
    _, back = network(entry)
    step = 1e-6 * draw.normal(size=len(entry))
    change = row @ (network(entry + step)[0] - network(entry - step)[0]) / 2
    assert back(row) @ step == pytest.approx(change, rel=1e-4)

"""Chunks that arrive 0.3 s late: a flow policy passes an obstacle in stepped time, by the real loop."""

from __future__ import annotations

import numpy as np
from flow_policy import PERIOD_NS, RATE_HZ, STEPS, FlowPolicy, Run, drive
from joshua.api import Observation
from joshua.api.models import ChunkRequest
from joshua.features import STATE

WAYS = 6


def ways(strategy: str) -> list[Run]:
    return [drive(strategy, seed=seed) for seed in range(WAYS)]


def test_real_time_chunking_halves_the_jumps_at_borders_and_succeeds_as_often():
    replacing, continuing = ways("REPLACE_ON_ARRIVAL"), ways("REAL_TIME_CHUNKING")
    jumps, continued = (
        np.mean([way.figures.border_mean_rad for way in some]) for some in (replacing, continuing)
    )
    assert continued < 0.5 * jumps, (continued, jumps)
    assert sum(way.passed for way in continuing) >= sum(way.passed for way in replacing)
    assert all(way.figures.borders >= 5 and not way.figures.gaps for way in continuing)


def test_late_steps_are_skipped_and_the_age_is_that_of_the_observation():
    way = drive("REPLACE_ON_ARRIVAL", seed=1)
    late = round(0.3 * RATE_HZ)
    assert way.figures.skipped == late * way.figures.chunks
    assert way.figures.age_p50_s > 0.3


def test_a_synchronous_arm_holds_while_the_model_computes():
    way = drive("SYNCHRONOUS", seed=1)
    assert way.figures.skipped == 0
    assert way.figures.gaps > 0


def test_no_command_is_faster_than_the_limit():
    way = drive("REPLACE_ON_ARRIVAL", seed=3, max_velocity_rad_s=0.8)
    steps = np.abs(np.diff(way.commands[20:], axis=0)).max()
    assert steps <= 0.8 / RATE_HZ + 1e-9
    free = drive("REPLACE_ON_ARRIVAL", seed=3)
    assert np.abs(np.diff(free.commands[20:], axis=0)).max() > 0.8 / RATE_HZ


def test_the_policy_keeps_what_is_fixed():
    observation = Observation(PERIOD_NS, {STATE: np.array([0.3, 0.3])})
    planned = FlowPolicy(1).act(observation)
    free = FlowPolicy(2).act(observation)
    continued = FlowPolicy(2).continue_chunk(observation, ChunkRequest(planned, 9, 20))
    assert planned.shape == continued.shape == (STEPS, 2)
    assert np.abs(continued - planned)[:9].mean() < 0.5 * np.abs(free - planned)[:9].mean()

"""PASSIVE places every sample, and reports limits and collisions once each."""

from __future__ import annotations

import numpy as np
import pytest
from joshua_mujoco_sim.model_file import load_model
from joshua_mujoco_sim.physics import Physics
from joshua_mujoco_sim.replay import Replay
from joshua_mujoco_sim.trajectories.trajectory import Trajectory


@pytest.fixture
def physics() -> Physics:
    return Physics(load_model("so_arm100/scene.xml"))


def recording(joint: str, values: list[float]) -> Trajectory:
    return Trajectory(
        "wave.csv", (joint,), np.arange(len(values), dtype=float) * 0.1, np.array(values)[:, None]
    )


def test_time_decides_which_samples_are_placed(physics: Physics) -> None:
    replay = Replay(physics, [recording("shoulder_pan", [0.0, 0.1, 0.2, 0.3])], speed=2.0)
    replay.advance(0.0)
    assert replay.samples == 1
    replay.advance(0.1)  # 0.2 s of the recording
    assert replay.samples == 3
    assert physics.data.joint("shoulder_pan").qpos[0] == pytest.approx(0.2)
    assert not replay.done
    replay.advance(1.0)
    assert replay.done
    assert "within the limits, without a collision" in replay.report()


def test_as_fast_as_possible_is_bounded_by_call(physics: Physics) -> None:
    replay = Replay(physics, [recording("shoulder_pan", [0.0] * 50)], speed=0.0)
    replay.advance(0.0, most=20)
    assert replay.samples == 20
    replay.advance(0.0)
    assert replay.done


def test_broken_limit_is_reported_once_and_again_when_it_comes_back(physics: Physics) -> None:
    replay = Replay(physics, [recording("shoulder_pan", [0.0, 2.5, 2.5, 0.0, -2.5])], speed=0.0)
    replay.advance(0.0)
    texts = [breach.text for breach in replay.breaches]
    assert len(texts) == 2
    assert texts[0].startswith("limit exceeded: shoulder_pan at +2.500 rad, allowed -2.200 to +2.200")
    assert texts[0].endswith("(wave.csv, 0.10 s)")
    assert replay.breaches[1].time_s == pytest.approx(0.4)
    assert "2 exceeded limit(s), 0 collision(s)" in replay.report()


def test_collision_names_both_bodies(physics: Physics) -> None:
    replay = Replay(physics, [recording("shoulder_lift", [-1.57, 0.1])], speed=0.0)
    replay.advance(0.0)
    assert any("with table" in breach.text and "mm deep" in breach.text for breach in replay.breaches)


def test_recordings_follow_one_another(physics: Physics) -> None:
    parts = [recording("shoulder_pan", [0.0, 0.1]), recording("gripper", [0.5, 0.6])]
    replay = Replay(physics, parts, speed=1.0)
    for _ in range(10):
        replay.advance(0.1)
    assert replay.done
    assert replay.samples == 4
    assert physics.data.joint("gripper").qpos[0] == pytest.approx(0.6)

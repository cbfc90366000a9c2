"""A seed varies the scene: the same seed the same way, bit by bit, and another seed another way."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from joshua_mujoco_sim.model_file import load_model
from joshua_mujoco_sim.opengl import RenderingError, choose_gl
from joshua_mujoco_sim.physics import Physics
from joshua_mujoco_sim.rendering import CameraRenderer
from joshua_mujoco_sim.variation import Variation

AMOUNTS = {"joint_rad": 0.05, "object_m": 0.02, "light": 0.3, "camera_m": 0.005, "camera_rad": 0.02}


def physics(seed: int | None, model: str = "so_arm100/pick_place.xml", **amounts: float) -> Physics:
    variation = None if seed is None else Variation(seed=seed, **(AMOUNTS | amounts))
    return Physics(load_model(model), variation=variation)


def scene(found: Physics) -> list:
    model, data = found.model, found.data
    parts = (data.qpos, data.ctrl, model.light_diffuse, model.light_pos, model.cam_pos, model.cam_quat)
    return [np.array(part) for part in parts]


def same(first: list, second: list) -> list[bool]:
    return [np.array_equal(a, b) for a, b in zip(first, second, strict=True)]


def test_seed_decides_every_start() -> None:
    one, two, other = physics(7), physics(7), physics(8)
    first = scene(one)
    assert all(same(first, scene(two)))
    assert not any(same(first, scene(other)))
    for found in (one, two):
        found.step(10)
        found.reset()
    assert all(same(scene(one), scene(two)))
    assert not any(same(first, scene(one)))  # the next start is another one
    one.reset(0)
    assert all(same(first, scene(one)))  # and any start can be had again


def test_changes_stay_within_their_sizes() -> None:
    nominal, varied = physics(None), physics(1)
    for start in range(20):
        varied.reset(start)
        joints = varied.data.qpos[:6] - nominal.data.qpos[:6]
        assert np.abs(joints).max() <= 0.05 + 1e-9
        assert np.array_equal(varied.data.ctrl, varied.data.qpos[:6])
        cube = varied.data.qpos[6:9] - nominal.data.qpos[6:9]
        assert np.abs(cube).max() <= 0.02 + 1e-9
        assert np.linalg.norm(varied.data.qpos[9:13]) == pytest.approx(1.0)
        assert np.abs(varied.model.cam_pos - nominal.model.cam_pos).max() <= 0.005 + 1e-9
        assert np.linalg.norm(varied.model.cam_quat, axis=1) == pytest.approx(1.0)
        for model in (nominal.model, varied.model):  # the lights still shine on the same place of the table
            places = model.light_pos - model.light_dir * (model.light_pos[:, 2:] / model.light_dir[:, 2:])
            assert places[0, :2] == pytest.approx([0.01, -0.18], abs=1e-6)


@pytest.mark.parametrize("part", range(4))
def test_a_part_of_size_zero_stays_as_it_is(part: int) -> None:
    sizes = [("joint_rad",), ("object_m",), ("light",), ("camera_m", "camera_rad")][part]
    nothing: dict[str, Any] = dict.fromkeys(sizes, 0.0)
    nominal, varied, rest = physics(None), physics(3, **nothing), physics(3)
    touched = [slice(0, 6), slice(6, 13)]
    if part < 2:
        assert np.array_equal(varied.data.qpos[touched[part]], nominal.data.qpos[touched[part]])
        assert np.array_equal(varied.data.qpos[touched[1 - part]], rest.data.qpos[touched[1 - part]])
    else:
        names = [("light_pos", "light_diffuse"), ("cam_pos", "cam_quat")][part - 2]
        for name in names:
            assert np.allclose(getattr(varied.model, name), getattr(nominal.model, name), atol=1e-12)
        assert np.array_equal(varied.data.qpos, rest.data.qpos)


def test_pictures_follow_the_seed() -> None:
    try:
        choose_gl()
    except RenderingError as error:
        pytest.skip(f"no picture can be drawn here: {error}")
    pictures = []
    for seed in (7, 7, 8):
        found = physics(seed, object_m=0, joint_rad=0)
        renderer = CameraRenderer(found.model, "top", 96, 64)
        renderer.look(found.data)
        pictures.append(renderer.draw())
        renderer.close()
    assert np.array_equal(pictures[0], pictures[1])
    assert np.abs(pictures[0].astype(int) - pictures[2]).mean() > 1


@pytest.mark.parametrize("model", ["lekoch/scene.xml", "ant/ant.xml"])
def test_any_robot_can_be_varied(model: str) -> None:
    first, second = physics(1, model), physics(2, model)
    assert not np.array_equal(first.data.qpos, second.data.qpos)
    first.step(100)

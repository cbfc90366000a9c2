"""What an action can mean, and what an observation can show."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from joshua.features import ACTION
from joshua_mujoco_sim.envs import TASKS, TermEnv, TermVectorEnv, make_environment
from joshua_mujoco_sim.envs.tasks import reach
from joshua_mujoco_sim.opengl import RenderingError, choose_gl


def has_gl() -> bool:
    try:
        choose_gl()
    except RenderingError:
        return False
    return True


def test_unknown_modes_are_refused() -> None:
    with pytest.raises(ValueError, match="render_mode 'human' is unknown"):
        TermEnv(TASKS["joshua/Ant-v0"], render_mode="human")
    with pytest.raises(ValueError, match=r"ant.xml has no action mode 'delta': choose torque"):
        TermEnv(TASKS["joshua/Ant-v0"], action_mode="delta")
    with pytest.raises(ValueError, match="observation_mode 'picture' is unknown: choose state, pixels, both"):
        TermEnv(reach, observation_mode="picture")
    with pytest.raises(ValueError, match="has no camera 'back': choose top, front, wrist"):
        TermEnv(reach, observation_mode="pixels", cameras=["back"])
    with pytest.raises(ValueError, match="cameras have no effect with observation_mode 'state'"):
        TermEnv(reach, cameras=["front"])
    refused: list[tuple[str, dict[str, Any]]] = [
        ("shadows have", {"shadows": True}),
        ("width has", {"width": 64}),
        ("height has", {"height": 48}),
    ]
    for name, option in refused:
        said = f"^{name} no effect with observation_mode 'state': choose pixels or both$"
        with pytest.raises(ValueError, match=said):
            TermEnv(reach, **option)
        with pytest.raises(ValueError, match=said):
            TermVectorEnv(reach, 2, **option)
        TermEnv(reach, render_mode="rgb_array", **option).close()
    with pytest.raises(ValueError, match="DISABLED is not offered: choose NEXT_STEP or SAME_STEP"):
        TermVectorEnv(reach, 2, autoreset_mode="Disabled")


def test_goals_of_a_data_set_move_the_arm_as_it_was_recorded() -> None:
    """What ``delta`` commanded, given to ``absolute`` as goals in rad, makes the same episode."""
    name = "joshua/SoArm100PickPlace-v0"
    recorded = make_environment(name, disable_env_checker=True).unwrapped
    replayed = make_environment(name, action_mode="absolute", disable_env_checker=True).unwrapped
    recorded.reset(seed=3)
    replayed.reset(seed=3)
    assert replayed.features[ACTION].unit == "rad"
    low, high = replayed.state.model.actuator_ctrlrange.T
    assert (replayed.action_space.low >= low).all()
    assert (replayed.action_space.high <= high).all()
    chance = np.random.default_rng(0)
    for _ in range(30):
        recorded.step(chance.uniform(-1, 1, 6))
        replayed.step(recorded.state.ctrl[0].copy())
        assert np.array_equal(recorded.state.qpos, replayed.state.qpos)
    replayed.step(np.full(6, 10.0))
    assert replayed.state.ctrl[0] == pytest.approx(high)


def test_commands_are_observed() -> None:
    environment = TermEnv(reach)
    environment.reset(seed=0)
    observation = environment.step(np.full(6, 0.7))[0]
    keys = list(environment.features)
    widths = [environment.features[key].shape[0] for key in keys]
    start = sum(widths[: keys.index("observation.lead")])
    state = environment.state
    assert environment.physical(observation)[start : start + 6] == pytest.approx(
        state.ctrl[0] - state.qpos[0, :6], abs=1e-6
    )


@pytest.mark.skipif(not has_gl(), reason="no OpenGL library: sudo apt install libegl1 libgl1-mesa-dri")
def test_observations_are_pictures_where_asked() -> None:
    options: dict[str, Any] = {"observation_mode": "both", "width": 64, "height": 48}
    cameras = ("wrist", "top")
    one = TermEnv(TASKS["joshua/SoArm100PickPlace-v0"], cameras=cameras, **options)
    many = TermVectorEnv(TASKS["joshua/SoArm100PickPlace-v0"], 2, cameras=cameras, **options)
    plain = TermEnv(TASKS["joshua/SoArm100PickPlace-v0"])
    shown, pictures = one.reset(seed=1)[0], many.reset(seed=1)[0]
    assert sorted(shown) == ["state", "top", "wrist"]
    assert one.observation_space.contains(shown)
    assert many.observation_space.contains(pictures)
    assert np.array_equal(shown["state"], plain.reset(seed=1)[0])
    for _ in range(2):
        for camera in cameras:
            assert np.array_equal(shown[camera], pictures[camera][0])
            assert shown[camera].std() > 10
        shown, pictures = one.step(np.full(6, 0.5))[0], many.step(np.full((2, 6), 0.5))[0]
    only = TermEnv(reach, observation_mode="pixels", width=32, height=24)
    assert list(only.reset(seed=0)[0]) == ["front"]
    for made in (one, many, only):
        made.close()


@pytest.mark.skipif(not has_gl(), reason="no OpenGL library: sudo apt install libegl1 libgl1-mesa-dri")
def test_shadows_darken_a_picture_where_asked() -> None:
    pictures = []
    for shadows in (False, True):
        made = TermVectorEnv(
            reach, 1, observation_mode="pixels", cameras=["top"], width=96, height=72, shadows=shadows
        )
        pictures.append(made.reset(seed=1)[0]["top"].astype(int))
        made.close()
    plain, shaded = pictures
    assert ((shaded - plain) < -10).mean() > 0.01

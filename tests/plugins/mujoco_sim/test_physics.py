"""Stepping, actuator groups and the detection of divergence."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from joshua_mujoco_sim.model_file import ModelError, load_model
from joshua_mujoco_sim.physics import DivergenceError, Physics


@pytest.fixture
def physics() -> Physics:
    return Physics(load_model("so_arm100/scene.xml"))


def test_starts_at_home_and_resets_there(physics: Physics) -> None:
    home = physics.data.qpos.copy()
    assert home[1] == pytest.approx(-1.57079)
    physics.group(()).set_command(np.zeros(6))
    physics.step(200)
    assert not np.allclose(physics.data.qpos, home)
    physics.reset()
    assert np.array_equal(physics.data.qpos, home)
    assert physics.time_s == 0


def test_unknown_keyframe_names_those_of_the_model() -> None:
    with pytest.raises(ModelError, match=r"no keyframe 'hom'.*home, rest"):
        Physics(load_model("so_arm100/scene.xml"), keyframe="hom")


def test_actuators_without_names_are_told_apart(tmp_path: Path) -> None:
    bodies = "".join(f"<body><geom size='0.1'/><joint name='{name}'/></body>" for name in ("one", "two"))
    drives = "".join(f"<position joint='{name}' kp='20'/>" for name in ("one", "two"))
    path = tmp_path / "arm.xml"
    path.write_text(f"<mujoco><worldbody>{bodies}</worldbody><actuator>{drives}</actuator></mujoco>")
    physics = Physics(load_model(str(path)))
    group = physics.group(())
    assert group.joints == ("one", "two")
    group.set_command(np.array([0.1, -0.2]))
    assert list(physics.data.ctrl) == [0.1, -0.2]
    with pytest.raises(ModelError, match="the model has no actuator ''"):
        physics.group(("", ""))


def test_group_follows_its_command_in_its_own_order(physics: Physics) -> None:
    group = physics.group(("gripper", "shoulder_pan"))
    group.set_command(np.array([0.7, -0.4]))
    physics.step(1500)
    assert group.joints == ("gripper", "shoulder_pan")
    assert group.position_rad == pytest.approx([0.7, -0.4], abs=0.02)
    assert group.velocity_rad_s == pytest.approx([0, 0], abs=0.01)
    assert group.range_min_rad == pytest.approx([-0.2, -2.2])


def test_unknown_actuator_says_the_nearest(physics: Physics) -> None:
    with pytest.raises(ModelError, match=r"no actuator 'elbow'.*did you mean elbow_flex"):
        physics.group(("elbow",))


def test_divergence_names_time_and_joint(physics: Physics, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    physics.step(100)
    physics.data.qvel[2] = np.nan
    with pytest.raises(
        DivergenceError, match=r"diverged at 0\.2\d\d s.*has no finite speed.*smaller timestep"
    ):
        physics.step(1)
    assert not list(tmp_path.iterdir())  # MuJoCo leaves no log file behind


def test_absurd_speed_is_divergence(physics: Physics) -> None:
    physics.data.qvel[4] = 1e6
    with pytest.raises(DivergenceError, match=r"wrist_roll has a speed"):
        physics.check()

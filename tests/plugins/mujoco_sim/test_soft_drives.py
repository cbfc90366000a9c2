"""Position drives that are too soft for their loads reach their goals, and squeeze nothing harder."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from joshua_mujoco_sim.model_file import load_model
from joshua_mujoco_sim.physics import Physics
from joshua_mujoco_sim.soft_drives import DROOP_SHARE, SoftDrives

#: A lift of 2 kg on a drive that droops by 20 N / 100 N/m; a block may lie above its way.
LIFT = """
<mujoco><worldbody>{block}
<body><joint name="lift" type="slide" axis="0 0 1" range="0 1" damping="5"/><geom size=".1" mass="2"/></body>
</worldbody><actuator><position name="lift" joint="lift" kp="{stiffness}" kv="20"/></actuator></mujoco>
"""


def lifted_m(physics: Physics, goal_m: float, time_s: float) -> tuple[float, float]:
    """Where the lift comes to rest, and the force of its drive."""
    group = physics.group(())
    drives = SoftDrives(physics, group)
    for _ in range(round(time_s / physics.timestep_s)):
        group.set_command(drives.shifted(np.array([goal_m])))
        physics.step()
    return float(group.position_rad[0]), float(group.torque[0])


def lift(folder: Path, *, block: str = "", stiffness: float = 100) -> Physics:
    (folder / "lift.xml").write_text(LIFT.format(block=block, stiffness=stiffness))
    return Physics(load_model("lift.xml", folder))


def test_a_soft_drive_reaches_its_goal_within_three_seconds(tmp_path: Path) -> None:
    position_m, force_n = lifted_m(lift(tmp_path), 0.6, 3.0)
    assert position_m == pytest.approx(0.6, abs=0.04)
    assert force_n == pytest.approx(2 * 9.81, rel=0.02)


def test_the_droop_of_a_stiffer_drive_stays_as_the_model_has_it(tmp_path: Path) -> None:
    stiffness = 2 * 9.81 / (0.9 * DROOP_SHARE)
    position_m, _ = lifted_m(lift(tmp_path, stiffness=stiffness), 0.6, 3.0)
    assert position_m == pytest.approx(0.6 - 0.9 * DROOP_SHARE, abs=1e-3)


def test_a_drive_that_something_stops_pushes_no_harder(tmp_path: Path) -> None:
    block = '<geom type="box" size=".2 .2 .05" pos="0 0 .75"/>'
    _, force_n = lifted_m(lift(tmp_path, block=block), 0.9, 3.0)
    assert force_n == pytest.approx(100 * (0.9 - 0.6), rel=0.1)


def test_an_arm_of_ours_keeps_its_own_servos() -> None:
    physics = Physics(load_model("so_arm100/scene.xml"))
    group = physics.group(())
    drives = SoftDrives(physics, group)
    goal = group.position_rad + np.array([0.5, 0.4, -0.5, 0.3, 0.4, 0.5])
    for _ in range(round(2 / physics.timestep_s)):
        group.set_command(drives.shifted(goal))
        physics.step()
    assert drives.shifted(goal) == pytest.approx(goal, abs=1e-12)


def test_a_released_joint_begins_without_a_shift(tmp_path: Path) -> None:
    physics = lift(tmp_path)
    group = physics.group(())
    drives = SoftDrives(physics, group)
    for _ in range(round(1 / physics.timestep_s)):
        group.set_command(drives.shifted(np.array([0.6])))
        physics.step()
    assert drives.shifted(np.array([0.6]))[0] > 0.65
    drives.reset()
    mujoco.mj_resetData(physics.model, physics.data)
    assert drives.shifted(np.array([0.0]))[0] == pytest.approx(0.0)

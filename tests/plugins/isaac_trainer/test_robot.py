"""The URDF for Isaac Sim moves as the MuJoCo model does, by MuJoCo's own reader of URDF."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from joshua_isaac_trainer import scene
from joshua_isaac_trainer.robot import AssetError, drives, robot_bodies, roll_pitch_yaw, urdf_of, write_urdf
from joshua_isaac_trainer.settings import TASKS
from joshua_mujoco_sim.envs import TASKS as ALL_TASKS
from joshua_mujoco_sim.envs import common_terms as common
from joshua_mujoco_sim.envs.terms import ResetTerm
from joshua_mujoco_sim.model_file import load_model

ARM = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return load_model("so_arm100/pick_place.xml")


def test_the_bodies_of_the_urdf_stand_where_those_of_the_model_stand(model, tmp_path: Path) -> None:
    path = write_urdf(model, "robot", tmp_path)
    assert path.name.count(".") == 1  # which Isaac Lab's converter requires
    copy = mujoco.MjModel.from_xml_path(str(path))
    names = [model.body(body).name for body in robot_bodies(model)][
        1:
    ]  # MuJoCo merges the base into the world
    generator = np.random.default_rng(1)
    ours, theirs = mujoco.MjData(model), mujoco.MjData(copy)
    for _ in range(20):
        for name in ARM:
            joint = model.joint(name)
            angle = generator.uniform(*joint.range)
            ours.joint(name).qpos[0] = theirs.joint(name).qpos[0] = angle
        mujoco.mj_forward(model, ours)
        mujoco.mj_forward(copy, theirs)
        for name in names:
            np.testing.assert_allclose(theirs.body(name).xpos, ours.body(name).xpos, atol=2e-6)
            np.testing.assert_allclose(theirs.body(name).xmat, ours.body(name).xmat, atol=2e-6)
            np.testing.assert_allclose(theirs.body(name).ximat, ours.body(name).ximat, atol=2e-6)
    for name in names:
        np.testing.assert_allclose(copy.body(name).mass, model.body(name).mass, rtol=1e-6)
        np.testing.assert_allclose(copy.body(name).inertia, model.body(name).inertia, rtol=1e-5)
    for name in ARM:
        np.testing.assert_allclose(copy.joint(name).range, model.joint(name).range, atol=1e-6)


def test_a_name_that_leads_out_of_the_folder_is_refused(model, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"the robot '\.\./robot' cannot be a file name"):
        write_urdf(model, "../robot", tmp_path)


def test_the_same_model_is_written_once(model, tmp_path: Path) -> None:
    first = write_urdf(model, "robot", tmp_path)
    changed_ns = first.stat().st_mtime_ns
    assert write_urdf(model, "robot", tmp_path) == first
    assert first.stat().st_mtime_ns == changed_ns
    assert [path.name for path in tmp_path.iterdir()] == [first.name]


def test_drives_are_those_of_the_servos(model) -> None:
    found = drives(model)
    assert tuple(found) == ARM
    assert found["shoulder_pan"].stiffness == pytest.approx(998.22)
    assert found["shoulder_pan"].damping == pytest.approx(2.731 + 0.60)
    assert found["shoulder_pan"].effort == pytest.approx(3.35)
    assert found["gripper"].effort == pytest.approx(1.675)
    assert (found["elbow_flex"].armature, found["elbow_flex"].friction) == pytest.approx((0.028, 0.052))


def test_a_motor_is_no_servo() -> None:
    with pytest.raises(AssetError, match="is no position servo"):
        drives(load_model("ant/ant.xml"))


def test_a_slide_is_refused() -> None:
    text = """<mujoco><worldbody><body name="base"><geom size="0.1"/>
      <body name="arm"><joint name="turn" type="hinge"/><geom size="0.1"/>
        <body name="stick"><joint name="slide" type="slide"/><geom size="0.1"/></body></body>
    </body></worldbody></mujoco>"""
    with pytest.raises(AssetError, match="stick is not on a hinge at its origin"):
        urdf_of(mujoco.MjModel.from_xml_string(text), "robot")


def test_angles_turn_as_the_quaternion_does() -> None:
    generator = np.random.default_rng(0)
    attitudes = [*generator.normal(size=(50, 4)), (1, 0, 1, 0), (1, 0, -1, 0), (0.5, 0.5, 0.5, 0.5)]
    for attitude in attitudes:
        unit = np.asarray(attitude, float) / np.linalg.norm(attitude)
        roll, pitch, yaw = roll_pitch_yaw(unit)
        turned, wanted = np.empty(9), np.empty(9)
        parts = [
            np.array([np.cos(a / 2), *(np.sin(a / 2) * np.eye(3)[k])])
            for k, a in ((2, yaw), (1, pitch), (0, roll))
        ]
        product, step = parts[0], np.empty(4)
        for part in parts[1:]:
            mujoco.mju_mulQuat(step, product, part)
            product = step.copy()
        mujoco.mju_quat2Mat(turned, product)
        mujoco.mju_quat2Mat(wanted, unit)
        np.testing.assert_allclose(turned, wanted, atol=1e-6)


def test_table_and_cube_are_in_the_scene(model) -> None:
    boxes = {box.name: box for box in scene.parts(model)}
    assert set(boxes) == {"table", "cube"}
    assert boxes["cube"].size_m == pytest.approx((0.025, 0.025, 0.025))
    assert boxes["cube"].mass_kg == pytest.approx(0.015)
    assert boxes["table"].mass_kg is None
    assert boxes["table"].position_m[2] + boxes["table"].size_m[2] / 2 == pytest.approx(0.0)
    assert scene.free_bodies(model) == {"cube": slice(6, 13)}
    assert scene.decimation(0.04) == 8


@pytest.mark.parametrize("name", TASKS)
def test_what_a_task_varies_is_varied_in_isaac_lab(name: str) -> None:
    task = ALL_TASKS[name]()
    model = load_model(task.model_path)
    events = scene.randomisation(task, model)
    assert {term.name for term in task.randomisation} <= {key.removesuffix("_robot") for key in events}
    shown = {
        event.function.removeprefix("randomize_") + ":" + key: value
        for event in events.values()
        if event.asset == "robot"
        for key, value in event.parameters.items()
        if isinstance(value, tuple)
    }
    damping = shown.pop("actuator_gains:damping_distribution_params")
    servo, joint = 2.731, 0.60  # of which the task varies that of the joint
    expected = tuple((servo + factor * joint) / (servo + joint) for factor in (0.7, 1.3))
    assert damping == pytest.approx(expected)
    assert shown == {
        "actuator_gains:stiffness_distribution_params": (0.8, 1.2),
        "joint_parameters:friction_distribution_params": (0.5, 1.5),
        "rigid_body_material:static_friction_range": (0.7, 1.3),
        "rigid_body_material:dynamic_friction_range": (0.7, 1.3),
        "rigid_body_material:restitution_range": (0.0, 0.0),
    }
    assert {event.asset for event in events.values()} == {"robot", *scene.free_bodies(model)}
    assert float(model.geom("fixed_jaw_pad_1").friction[0]) == scene.FRICTION
    wider = replace(task.randomisation[0], parameters={"low": 0.5, "high": 2.0})
    event = scene.randomisation(replace(task, randomisation=(wider,)), model)["servo_gain"]
    assert event.parameters["stiffness_distribution_params"] == (0.5, 2.0)


def test_what_isaac_lab_cannot_vary_is_refused(model) -> None:
    task = ALL_TASKS["joshua/SoArm100PickPlace-v0"]()
    with pytest.raises(AssetError, match=r"randomise has no effect: the task on so_arm100/pick_place.xml"):
        scene.randomisation(replace(task, randomisation=()), model)
    mass = ResetTerm("load", common.randomise, {"field": "body_mass", "low": 0.5, "high": 2.0})
    with pytest.raises(AssetError, match="Isaac Lab has no event for load of so_arm100/pick_place"):
        scene.randomisation(replace(task, randomisation=(mass,)), model)
    (damping,) = (term for term in task.randomisation if term.name == "damping")
    uneven = load_model("so_arm100/pick_place.xml")
    uneven.joint("gripper").damping[0] = 0.1
    said = "randomise: damping changes the damping of the drives by different factors, "
    with pytest.raises(AssetError, match=said):
        scene.randomisation(replace(task, randomisation=(damping,)), uneven)

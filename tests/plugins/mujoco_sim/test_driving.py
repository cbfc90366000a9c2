"""Joints of foreign models reach positions in radians or metres, whatever their actuators take."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from joshua_mujoco_sim.model_file import ModelError
from joshua_mujoco_sim.physics import Physics
from joshua_mujoco_sim.position_loop import Gains

ARM = """
<mujoco><compiler angle="radian"/><option integrator="implicitfast"/><worldbody>
  <body pos="0 0 .3"><joint name="waist" axis="0 0 1" range="-3 3"/>
    <geom type="capsule" size=".04 .1" mass="1"/>
    <body pos="0 0 .25"><joint name="shoulder" axis="0 1 0" range="-1.5 1.5"/>
      <geom type="capsule" size=".03 .1" pos="0 0 .1" mass=".5"/>
      <body pos="0 0 .2"><joint name="elbow" axis="0 1 0" range="-2 2"/>
        <geom type="capsule" size=".02 .1" pos="0 0 .1" mass=".3"/></body></body></body>
</worldbody>{more}
<actuator>{actuators}</actuator></mujoco>
"""

GRIPPER = """
<mujoco><compiler angle="radian"/><worldbody><body pos="0 0 .3"><geom size=".03" mass=".3"/>
  <body><joint name="left" type="slide" axis="1 0 0" range="0 .04" {joint}/>
    <geom size=".01" mass=".05"/></body>
  <body><joint name="right" type="slide" axis="-1 0 0" range="0 .04" {joint}/>
    <geom size=".01" mass=".05"/></body>
</body></worldbody>
<tendon><fixed name="split"><joint joint="left" coef=".5"/><joint joint="right" coef=".5"/></fixed></tendon>
<equality><joint joint1="left" joint2="right"/></equality>
<actuator>{actuators}</actuator></mujoco>
"""

JOINTS = ("waist", "shoulder", "elbow")


def each(actuator: str) -> str:
    """The actuator for every joint of the arm, without a name."""
    return "".join(actuator.replace("JOINT", joint) for joint in JOINTS)


def arm(actuators: str, more: str = "") -> Physics:
    return Physics(mujoco.MjModel.from_xml_string(ARM.format(actuators=actuators, more=more)))


def gripper(actuators: str, joint: str = "") -> Physics:
    xml = GRIPPER.format(actuators=actuators, joint=joint)
    model = mujoco.MjModel.from_xml_string(xml)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)  # the fingers start inside each other
    return Physics(model)


def largest_miss(physics: Physics) -> float:
    """Drive all joints to 20 % and 80 % of their ranges, and return the largest miss as a share of one."""
    group = physics.group(())
    ranges = physics.drivable_joints()
    low = np.array([joint.low for joint in ranges])
    high = np.array([joint.high for joint in ranges])
    misses = []
    for share in (0.2, 0.8):
        physics.reset()
        goal = low + share * (high - low)
        group.set_command(goal)
        physics.step(round(3 / physics.timestep_s))
        misses.append(np.abs((group.position_rad - goal) / (high - low)).max())
    return float(max(misses))


@pytest.mark.parametrize(
    "actuator",
    [
        '<motor joint="JOINT" gear="10" ctrlrange="-1 1"/>',
        '<motor joint="JOINT"/>',
        '<motor joint="JOINT" forcerange="-8 8" gear="-2"/>',
        '<general joint="JOINT" gainprm="30" dyntype="filter" dynprm=".05" ctrlrange="-1 1"/>',
        '<general joint="JOINT" gainprm="30" dyntype="filterexact" dynprm=".05" ctrlrange="-1 1"/>',
        '<general joint="JOINT" gaintype="affine" gainprm="5 .5 0" biastype="affine" biasprm="1 .2 -.1"/>',
        '<velocity joint="JOINT" kv="3" ctrlrange="-4 4"/>',
        '<velocity joint="JOINT" kv=".05"/>',
        '<intvelocity joint="JOINT" kp="60" kv="3" ctrlrange="-4 4" actrange="-3 3"/>',
        '<cylinder joint="JOINT" timeconst=".05" area="12" ctrlrange="-1 1"/>',
        '<position joint="JOINT" kp="80" dampratio="1"/>',
        '<general joint="JOINT" gainprm="2" biastype="affine" biasprm="3 -60 -3" gear="1.5"/>',
    ],
)
def test_each_kind_of_actuator_reaches_its_goal(actuator: str) -> None:
    assert largest_miss(arm(each(actuator))) < 0.02


@pytest.mark.parametrize(
    ("actuators", "joint"),
    [
        (
            '<general tendon="split" ctrlrange="0 255" gainprm=".0157" biastype="affine" '
            'biasprm="0 -100 -10"/>',
            "",
        ),
        ('<motor tendon="split" ctrlrange="-20 20"/>', ""),
        ('<velocity tendon="split" kv="20"/>', ""),
        ('<motor joint="left"/><motor joint="right"/>', 'damping="1" frictionloss=".5"'),
        ('<position joint="left" kp="500" kv="20"/><position joint="right" kp="500" kv="20"/>', ""),
    ],
)
def test_coupled_fingers_are_one_joint_in_metres(actuators: str, joint: str) -> None:
    physics = gripper(actuators, joint)
    assert physics.group(()).joints == ("left",)
    assert physics.group(()).units == ("m",)
    assert largest_miss(physics) < 0.03
    right = physics.data.joint("right").qpos[0]
    assert right == pytest.approx(physics.group(()).position_rad[0], abs=1e-3)


def test_a_tendon_over_independent_joints_follows_its_length() -> None:
    tendon = '<tendon><fixed name="both"><joint joint="shoulder" coef="1"/><joint joint="elbow" coef="1"/>'
    more = tendon + "</fixed></tendon>"
    hold = '<position joint="waist" kp="80" dampratio="1"/>'
    for drive in ('<position tendon="both" kp="80" kv="3"/>', '<motor tendon="both"/>'):
        physics = arm(hold + drive, more)
        group = physics.group(("both",))
        group.set_command(np.array([0.6]))
        physics.step(1500)
        assert group.position_rad == pytest.approx([0.6], abs=0.1)


def test_a_pair_of_actuators_is_driven_by_its_position_drive() -> None:
    pair = '<velocity joint="JOINT" kv="2"/><position joint="JOINT" kp="80"/>'
    physics = arm(each(pair))
    assert physics.group(()).kinds == ("position",) * 3
    assert largest_miss(physics) < 0.02
    assert list(physics.data.ctrl[::2]) == [0.0, 0.0, 0.0]  # the velocity drives only brake


def test_a_motor_holds_as_far_as_its_force_allows() -> None:
    physics = arm(each('<motor joint="JOINT" forcerange="-.4 .4"/>'))
    group = physics.group(("shoulder",))
    physics.data.joint("shoulder").qpos[0] = 1.4
    mujoco.mj_forward(physics.model, physics.data)
    group.set_command(np.array([0.0]))
    physics.step(1500)
    assert abs(group.position_rad[0]) > 0.2
    assert abs(group.torque[0]) == pytest.approx(0.4)


def test_a_released_motor_lets_its_joint_fall() -> None:
    physics = arm(each('<motor joint="JOINT" gear="10"/>'))
    group = physics.group(())
    group.set_command(np.array([0.0, 0.5, 0.0]))
    physics.step(1500)
    held = group.position_rad
    for _ in range(500):
        group.let_go()
        physics.step()
    assert held[1] == pytest.approx(0.5, abs=0.01)
    assert np.abs(group.position_rad - held).max() > 0.3


def test_gains_of_the_file_replace_those_of_the_inertia() -> None:
    physics = arm(each('<motor joint="JOINT"/>'))
    group = physics.group(("elbow", "waist"))
    group.set_gains(1, Gains(position=0.2, velocity=0.0))
    group.set_command(np.array([0.0, 1.0]))
    inertia = np.zeros(physics.model.nv)
    mujoco.mj_mulM(physics.model, physics.data, inertia, np.array([1.0, 0.0, 0.0]))
    period_s = 2 * np.pi * np.sqrt(inertia[0] / 0.2)
    physics.step(round(period_s / 2 / physics.timestep_s))
    assert group.position_rad[1] == pytest.approx(2.0, abs=0.1)  # undamped, it swings to the other side
    assert group.position_rad[0] == pytest.approx(0.0, abs=0.02)


def test_gains_that_are_large_for_the_time_step_are_stable() -> None:
    physics = arm(each('<motor joint="JOINT"/>'))
    group = physics.group(())
    for place in range(3):
        group.set_gains(place, Gains(position=500.0, velocity=40.0))
    assert largest_miss(physics) < 0.02


def test_goals_of_a_loop_end_with_a_reset() -> None:
    physics = arm(each('<motor joint="JOINT"/>'))
    group = physics.group(())
    group.set_command(np.array([0.4, 0.5, 0.6]))
    assert list(group.command) == [0.4, 0.5, 0.6]
    physics.reset()
    assert not physics.loop.active
    assert list(group.command) == [0.0, 0.0, 0.0]


def test_placing_a_gripper_places_both_fingers() -> None:
    physics = gripper('<motor tendon="split"/>')
    physics.group(()).set_position(np.array([0.03]))
    assert physics.data.joint("right").qpos[0] == pytest.approx(0.03)


def test_a_refused_actuator_and_a_joint_named_twice_say_why() -> None:
    physics = arm(
        each('<motor joint="JOINT"/>') + '<damper name="brake" joint="elbow" kv="1" ctrlrange="0 1"/>'
    )
    with pytest.raises(ModelError, match="actuator brake is a damper, which only brakes, so it cannot be"):
        physics.group(("brake",))
    with pytest.raises(ModelError, match="'elbow' and 'elbow' are the same joint elbow: name it once"):
        physics.group(("elbow", "elbow"))


def test_a_position_drive_that_is_too_soft_for_its_weight_is_helped() -> None:
    soft, stiff = (
        '<position joint="JOINT" kp="2" kv=".2"/>',
        '<position joint="JOINT" kp="80" dampratio="1"/>',
    )
    assert arm(each(soft)).group(()).kinds == (
        "position",
        "torque",
        "torque",
    )  # gravity does not turn the waist
    assert largest_miss(arm(each(soft))) < 0.02
    assert arm(each(stiff)).group(()).kinds == ("position",) * 3


def test_a_joint_that_starts_outside_its_limits_starts_at_the_nearest() -> None:
    xml = ARM.format(actuators=each('<motor joint="JOINT"/>'), more="")
    model = mujoco.MjModel.from_xml_string(xml.replace('range="-2 2"', 'range=".3 2"'))
    assert Physics(model).group(("elbow",)).position_rad == pytest.approx([0.3])


def test_a_falling_robot_moves_its_joints_as_on_a_stand() -> None:
    base = '<body name="base"><freejoint/><geom size=".08" mass=".5"/>'
    xml = ARM.format(actuators=each('<motor joint="JOINT" ctrlrange="-20 20"/>'), more="")
    xml = xml.replace("<worldbody>", f"<worldbody>{base}").replace("</worldbody>", "</body></worldbody>")
    assert largest_miss(Physics(mujoco.MjModel.from_xml_string(xml))) < 0.01

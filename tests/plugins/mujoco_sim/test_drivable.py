"""Which joints of a model can be driven, by which names, and why the others cannot."""

from __future__ import annotations

import mujoco
import pytest
from joshua_mujoco_sim.drivable import Drivables, drivables, refusals

GRIPPER = """
<mujoco><compiler angle="radian"/><worldbody>
  <body pos="0 0 1"><joint name="elbow" range="-2 1"/><geom size=".05" pos=".2 0 0"/>
    <body><joint name="left" type="slide" axis="1 0 0" range="0 .04"/><geom size=".01"/></body>
    <body><joint name="right" type="slide" axis="-1 0 0" range="0 .03"/><geom size=".01"/></body>
  </body>
</worldbody>
<tendon><fixed name="split"><joint joint="left" coef=".5"/><joint joint="right" coef=".5"/></fixed></tendon>
<equality><joint joint1="left" joint2="right"/></equality>
<actuator>
  <position joint="elbow" kp="10" ctrlrange="-1 1.5"/>
  <general name="fingers" tendon="split" ctrlrange="0 255" gainprm=".0157" biastype="affine"
    biasprm="0 -100 -10"/>
</actuator></mujoco>
"""

MIXED = """
<mujoco><compiler angle="radian"/><worldbody>
  <body pos="0 0 1"><freejoint name="base"/><geom size=".05"/><site name="nozzle"/>
    <body><joint name="shoulder" type="ball"/><geom size=".05" pos=".2 0 0"/>
      <body name="forearm"><joint name="wrist"/><geom size=".05" pos=".2 0 0"/>
        <body name="hand"><joint range="-1 1"/><geom size=".05" pos=".2 0 0"/></body></body></body></body>
</worldbody>
<actuator>
  <motor name="thruster" site="nozzle"/>
  <motor name="twist" joint="shoulder"/>
  <motor name="push" joint="base"/>
  <muscle name="biceps" joint="wrist" lengthrange="0 1"/>
  <damper name="brake" joint="wrist" kv="1" ctrlrange="0 1"/>
  <adhesion name="glue" body="hand" ctrlrange="0 1"/>
  <motor name="torque" joint="wrist"/>
  <velocity name="speed" joint="wrist" kv="2"/>
  <position name="angle" joint="wrist" kp="3"/>
  <velocity name="idle" joint="wrist" kv="0"/>

</actuator></mujoco>
"""


def of(xml: str) -> Drivables:
    return drivables(mujoco.MjModel.from_xml_string(xml))


def test_coupled_fingers_on_a_tendon_are_one_joint_in_metres() -> None:
    elbow, fingers = of(GRIPPER).joints
    assert (elbow.name, elbow.unit, elbow.low, elbow.high) == ("elbow", "rad", -1, 1)
    assert (fingers.name, fingers.unit, fingers.kind) == ("left", "m", "position")
    assert set(fingers.names) == {"left", "right", "split", "fingers"}
    assert (fingers.low, fingers.high) == (0, 0.03)  # the shorter of both fingers, and no raw control


def test_actuators_of_one_joint_drive_it_by_the_best_and_hold_the_others() -> None:
    joints = of(MIXED).joints
    assert [(joint.name, joint.kind) for joint in joints] == [("wrist", "position")]
    assert len(joints[0].drives) == 1
    assert len(joints[0].held) == 2
    assert set(joints[0].names) == {"wrist", "angle", "torque", "speed"}
    assert not joints[0].limited
    assert joints[0].high == pytest.approx(6.2832, abs=1e-4)


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("thruster", "pushes at a site and moves no joint of its own"),
        ("twist", "drives the ball joint shoulder, which has no single position"),
        ("push", "drives the free joint base, which has no single position"),
        ("biceps", "is a muscle, which takes an activation and no position"),
        ("brake", "is a damper, which only brakes"),
        ("glue", "is an adhesion, which attracts bodies and moves no joint"),
        ("idle", "has no gain, so its command has no effect"),
    ],
)
def test_each_refusal_names_one_actuator_and_why(name: str, reason: str) -> None:
    found = refusals(mujoco.MjModel.from_xml_string(MIXED))
    assert [str(refusal) for refusal in found if refusal.actuator == name] == [f"{name} {reason}"]


def test_an_actuator_without_a_name_is_known_by_its_joint() -> None:
    assert of(GRIPPER).joints[0].names == ("elbow",)
    assert "" not in of(GRIPPER).by_name()


def test_a_name_of_an_actuator_goes_before_that_of_a_joint() -> None:
    xml = GRIPPER.replace('<position joint="elbow"', '<position name="left" joint="elbow"')
    found = of(xml)
    assert found.by_name()["left"].name == "elbow"
    assert [joint.name for joint in found.joints] == ["elbow", "right"]


def test_a_tendon_over_independent_joints_is_driven_by_its_length() -> None:
    xml = GRIPPER.replace('<equality><joint joint1="left" joint2="right"/></equality>', "")
    split = of(xml).by_name()["split"]
    assert (split.unit, split.low) == ("m", 0)
    assert split.high == pytest.approx(0.035)
    assert split.tendon == 0

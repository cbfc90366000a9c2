from __future__ import annotations

import pytest
from joshua.features import FeatureSet
from joshua.features.needs import as_trained, joined, unmet
from joshua.plan import JointRange, ModelArm, ModelNeeds
from joshua.plan.feature import Feature

JOINTS = [JointRange("pan", -1.5, 1.5), JointRange("gripper", 0.0, 1.0)]
STATE = Feature.joints("observation.state", ("pan", "gripper"), topic="/arm/state")
TOP = Feature.picture("observation.images.top", 480, 640, topic="/top")
ROBOT = FeatureSet([STATE, TOP])
ACTION = Feature.joints("action", ("pan.pos", "gripper.pos"), unit="lerobot")


def found(needs: ModelNeeds, strategy: str = "", features: FeatureSet = ROBOT) -> list[tuple[str, str]]:
    return [(lack.message, lack.remedy) for lack in unmet(needs, features, JOINTS, 30.0, strategy)]


def test_a_model_that_fits_lacks_nothing():
    needs = ModelNeeds(
        features=(STATE, Feature.picture("observation.images.top", 0, 0)),
        action=ACTION,
        rate_hz=30.0,
        ranges={"action": ((-99.0, 2.0), (97.0, 100.0)), "observation.state": ((-1.0, 0.1), (1.4, 1.0))},
    )
    assert found(needs) == []
    assert found(ModelNeeds()) == [], "what is not known is asked after loading"


def test_a_camera_of_another_name_is_renamed():
    needs = ModelNeeds(features=(Feature.picture("observation.images.camera1", 480, 640),), source="c.json")
    assert found(needs) == [
        (
            "The model needs observation.images.camera1 (c.json); the robot provides observation.images.top",
            'Add rename { robot: "top" model: "camera1" } to the model',
        )
    ]


@pytest.mark.parametrize(
    ("needed", "remedy"),
    [
        (Feature.picture("observation.images.wrist", 0, 0), "one more camera"),
        (Feature.joints("observation.state", ()), "JOINT_STATE"),
    ],
)
def test_what_the_robot_does_not_show_needs_a_subscription(needed: Feature, remedy: str):
    ((message, said),) = found(ModelNeeds(features=(needed,)), features=FeatureSet())
    assert "provides none" in message
    assert "Add subscriptions" in said
    assert remedy in said


def test_another_size_of_pictures_names_both():
    needs = ModelNeeds(features=(Feature.picture("observation.images.top", 240, 320),))
    ((message, remedy),) = found(needs)
    assert "320 × 240 pixels, and /top has 640 × 480" in message
    assert remedy == "Set width: 320 height: 240 in the camera's block"


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (("gripper", "pan"), "the order differs: gripper, pan in the model, pan, gripper on the robot"),
        (("lift", "pan"), "the names differ"),
        (("pan",), "the model has 1 numbers, and the robot has 2: pan, gripper"),
    ],
)
def test_other_joints_are_named(names: tuple[str, ...], said: str):
    for needs in (
        ModelNeeds(features=(Feature.joints("observation.state", names),)),
        ModelNeeds(action=Feature.joints("action", names)),
    ):
        ((message, _),) = found(needs)
        assert said in message


def test_a_rate_and_a_strategy_that_do_not_go_together_with_the_model():
    (rate,) = found(ModelNeeds(rate_hz=50.0))
    assert rate == ("The model acts 50 times a second, and its node 30 times", "Set publish_rate_hz: 50")
    ((message, remedy),) = found(ModelNeeds(), "REAL_TIME_CHUNKING")
    assert "cannot continue a chunk" in message
    assert remedy == "Write strategy: REPLACE_ON_ARRIVAL"
    assert found(ModelNeeds(supports_rtc=True), "REAL_TIME_CHUNKING") == []


@pytest.mark.parametrize(
    ("unit", "least", "greatest"),
    [("rad", 0.0, 4095.0), ("deg", -400.0, 90.0), ("lerobot", 0.0, 4095.0), ("lerobot_deg", -90.0, 400.0)],
)
def test_statistics_of_another_unit_are_seen(unit: str, least: float, greatest: float):
    action = Feature.joints("action", ("pan", "gripper"), unit=unit)
    ((message, remedy),) = found(
        ModelNeeds(action=action, ranges={"action": ((least, 0.0), (greatest, 0.5))})
    )
    assert message.startswith("action: in training pan went from")
    assert "statistics" in remedy


def test_joints_take_the_order_of_the_model_where_both_name_the_same():
    needs = ModelNeeds(
        features=(Feature.joints("observation.state", ("gripper.pos", "pan.pos")),),
        action=Feature.joints("action", ("gripper.pos", "pan.pos"), unit="lerobot"),
    )
    features, joints = as_trained(needs, ROBOT, JOINTS)
    assert [joint.name for joint in joints] == ["gripper", "pan"]
    assert features["observation.state"].names == ("gripper", "pan")
    assert features["observation.state"].topic == "/arm/state"
    assert features["observation.images.top"] == TOP
    assert unmet(needs, features, joints, 30.0, "") == []
    assert as_trained(ModelNeeds(action=ACTION), ROBOT, JOINTS) == (ROBOT, tuple(JOINTS))


@pytest.mark.parametrize("names", [(), ("pan", "wrist"), ("pan",)])
def test_other_names_leave_the_order_of_the_robot(names: tuple[str, ...]):
    needs = ModelNeeds(action=Feature.joints("action", names))
    assert as_trained(needs, ROBOT, JOINTS) == (ROBOT, tuple(JOINTS))


def test_two_arms_with_the_same_names_are_not_permuted():
    twice = [*JOINTS, *JOINTS]
    needs = ModelNeeds(action=Feature.joints("action", ("gripper", "gripper", "pan", "pan")))
    assert as_trained(needs, ROBOT, twice) == (ROBOT, tuple(twice))


SIDES = ("left", "right")
STATES = FeatureSet(
    [
        Feature.joints(f"observation.state.{side}_arm", ("pan", "gripper"), topic=f"/{side}/state")
        for side in SIDES
    ]
    + [TOP]
)
ARMS = tuple(
    ModelArm(f"/{side}/commands", f"/{side}/state", ("pan", "gripper"), f"{side}_") for side in SIDES
)


def test_the_states_of_two_arms_become_one_for_a_model_that_names_its_joints():
    names = ("right_pan.pos", "right_gripper.pos", "left_pan.pos", "left_gripper.pos")
    needs = ModelNeeds(features=(Feature.joints("observation.state", names), TOP))
    whole = joined(needs, STATES, ARMS)
    assert whole["observation.state"] == Feature.joints(
        "observation.state", ("left_pan", "left_gripper", "right_pan", "right_gripper")
    )
    assert list(whole) == ["observation.state", "observation.images.top"]
    joints = [JointRange(name, -1.0, 1.0) for arm in ARMS for name in arm.names]
    features, ordered = as_trained(needs, whole, joints)
    assert features["observation.state"].names == tuple(name.removesuffix(".pos") for name in names)
    assert [joint.name for joint in ordered] == list(features["observation.state"].names)
    assert unmet(needs, features, ordered, 30.0, "") == []
    assert joined(needs, whole, ARMS) is whole
    assert joined(needs, STATES, ()) is STATES
    others = ModelNeeds(features=tuple(STATES.values()))
    assert joined(others, STATES, ARMS) is STATES  # a model with a state for each arm


def test_one_state_for_two_arms_without_names_is_refused_by_its_reason():
    needs = ModelNeeds(features=(Feature("observation.state", "float32", (4,)),), source="c.json")
    assert joined(needs, STATES, ARMS) is STATES
    assert found(needs, features=STATES) == [
        (
            "The model has one observation.state for all arms without names of its joints (c.json), so it is "
            "unclear which of them belong to left_arm, right_arm",
            "Put meta/info.json of its data set beside the weights, which has the names",
        )
    ]

"""A model of two arms: one state from two topics, and one action to two topics."""

from __future__ import annotations

import numpy as np
import pytest
from joshua.api.nodes import ModelArm, TopicSpec
from joshua.features import Feature, FeatureSet
from joshua.messages.make import joint_state
from joshua.plan import NodeKind, NodeSpec
from joshua.testing.recording_context import RecordingContext
from joshua_inference.commands import Commands
from joshua_inference.observer import Observer, UnfitMessageError

ARMS = (
    ModelArm("/left/commands", "/left/state", ("pan", "gripper"), "left_"),
    ModelArm("/right/commands", "/right/state", ("pan", "gripper"), "right_"),
)
NAMES = ("right_pan", "left_pan", "left_gripper", "right_gripper")
STATE = Feature.joints("observation.state", NAMES)


def test_the_state_is_made_of_a_message_of_each_arm() -> None:
    seen = Observer(FeatureSet([STATE]), 3600.0, arms=ARMS)
    assert seen.missing() == ("/left/state", "/right/state")
    seen.add("/left/state", joint_state(["gripper", "pan"], [0.2, 0.1], at_ns=9), 100)
    assert seen.missing() == ("/right/state",)
    seen.add("/right/state", joint_state(["pan", "gripper"], [1.1, 1.2], at_ns=7), 100)
    assert seen.missing() == ()
    observation = seen.observation()
    assert observation["observation.state"].tolist() == pytest.approx([1.1, 0.1, 0.2, 1.2])
    assert observation.stamps_ns == {"observation.state": 7}, "of the older one"
    assert seen.observation()["observation.state"] is observation["observation.state"], "made once"
    seen.add("/left/state", joint_state(["pan", "gripper"], [0.3, 0.2], at_ns=11), 110)
    assert seen.observation()["observation.state"].tolist() == pytest.approx([1.1, 0.3, 0.2, 1.2])
    seen.add("/left/state", joint_state(["pan"], [0.3], at_ns=12), 120)
    with pytest.raises(UnfitMessageError, match="a message on /left/state is not used"):
        seen.observation()
    assert seen.missing() == ("/left/state",)


def test_each_arm_gets_its_own_joints_by_its_own_names() -> None:
    kind = "sensor_msgs/msg/JointState"
    topics = [
        TopicSpec(name=name, type_name=kind, rate_hz=50.0) for name in ("/left/commands", "/right/commands")
    ]
    context = RecordingContext(NodeSpec(name="policy", kind=NodeKind.MODEL, behaviour="", implementation=""))
    commands = Commands([context.publisher(topic) for topic in topics], 50.0, ARMS)
    commands.use(NAMES)
    commands.publish(np.array([1.1, 0.1, 0.2, 1.2]), 5, "base")
    sent = {name: item.messages for name, item in context.publishers.items()}
    ((left,), (right,)) = sent["/left/commands"], sent["/right/commands"]
    assert dict(zip(left.name, left.position.tolist(), strict=True)) == {"pan": 0.1, "gripper": 0.2}
    assert dict(zip(right.name, right.position.tolist(), strict=True)) == {"pan": 1.1, "gripper": 1.2}
    assert [row[0] for row in commands.checks()] == ["rate of /left/commands", "rate of /right/commands"]

from __future__ import annotations

import time

import numpy as np
import pytest
from joshua.features import Feature, FeatureSet
from joshua.messages.make import image, joint_state
from joshua_inference.observer import Observer, UnfitMessageError

STATE = Feature.joints("observation.state", ("a", "b"), topic="/arm")
TOP = Feature.picture("observation.images.top", 2, 3, topic="/top")
PICTURE = np.arange(18, dtype=np.uint8).reshape(2, 3, 3)


def observer() -> Observer:
    return Observer(FeatureSet([STATE, TOP]), 3600.0, "wave")


def test_the_newest_of_each_feature_is_an_array_with_its_stamp() -> None:
    seen = observer()
    assert seen.missing() == ("/arm", "/top")
    seen.add("/arm", joint_state(["a", "b"], [9.0, 9.0], at_ns=5), 100)
    seen.add("/arm", joint_state(["b", "a"], [2.0, 1.0], at_ns=10), 110)
    seen.add("/top", image(PICTURE[:, :, ::-1], "bgr8", at_ns=7), 120)
    assert seen.missing() == ()
    observation = seen.observation()
    assert observation["observation.state"].tolist() == [1.0, 2.0]
    assert observation["observation.state"].dtype == np.float32
    assert (observation["observation.images.top"] == PICTURE).all()
    assert observation.stamps_ns == {"observation.state": 10, "observation.images.top": 7}
    assert (observation.stamp_ns, observation.task) == (10, "wave")
    assert seen.observation()["observation.state"] is observation["observation.state"], "converted once"


@pytest.mark.parametrize(
    ("topic", "message", "text"),
    [
        (
            "/arm",
            joint_state(["a"], [1.0]),
            "on /arm is not used: a JointState has positions of a, and a, b are",
        ),
        (
            "/top",
            image(np.zeros((4, 3, 3), np.uint8)),
            r"on /top is not used: .*shape \(4, 3, 3\), and \(2, 3, 3\)",
        ),
        ("/top", image(np.zeros((2, 3), np.uint16), "16UC1"), "on /top is not used: .* has no colours"),
    ],
)
def test_a_message_that_does_not_fit_is_dropped_and_named(topic: str, message: object, text: str) -> None:
    seen = observer()
    seen.add("/arm", joint_state(["a", "b"], [1.0, 2.0]), 1)
    seen.add("/top", image(PICTURE), 1)
    seen.add(topic, message, 2)
    with pytest.raises(UnfitMessageError, match=text):
        seen.observation()
    assert seen.missing() == (topic,)


def test_what_is_too_old_is_missing() -> None:
    seen = Observer(FeatureSet([STATE]), 0.02)
    seen.add("/arm", joint_state(["a", "b"], [1.0, 2.0]), 1)
    time.sleep(0.03)
    assert seen.missing() == ("/arm",)


def test_an_observation_of_nothing_has_the_time_of_its_making() -> None:
    observation = Observer(FeatureSet()).observation()
    assert abs(observation.stamp_ns - time.time_ns()) < 60e9
    assert observation.values == {}

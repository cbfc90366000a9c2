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


def test_a_model_that_looks_back_sees_the_periods_before() -> None:
    """Messages at 50 Hz and pictures at 25 Hz, for a model of 25 Hz; each by the time of its acquisition."""
    seen = observer()
    seen.look_back(3, 0.04)
    begin_ns, ms = 10**18, 10**6
    for step in range(10):
        at_ns = begin_ns + step * 20 * ms
        seen.add("/arm", joint_state(["a", "b"], [step, -step], at_ns=at_ns), at_ns)
        if step % 2 == 0:
            seen.add("/top", image(np.full((2, 3, 3), step, np.uint8), at_ns=at_ns), at_ns)
    now = seen.observation()
    assert now["observation.state"].tolist() == [9.0, -9.0]
    states = [item["observation.state"][0] for item in now.earlier]
    pictures = [int(item["observation.images.top"][0, 0, 0]) for item in now.earlier]
    assert states == [8.0, 6.0], "the newest one within half a period of the moment"
    assert pictures == [8, 6]
    assert now.stamp_ns - now.earlier[-1].stamp_ns == 60 * ms
    again = seen.observation().earlier[0]
    assert again["observation.state"] is now.earlier[0]["observation.state"], "converted once"
    seen.forget()
    at_ns = begin_ns + 200 * ms
    seen.add("/arm", joint_state(["a", "b"], [10.0, -10.0], at_ns=at_ns), at_ns)
    first = seen.observation()
    assert [item["observation.state"][0] for item in first.earlier] == [10.0, 10.0], "an episode has begun"


def test_of_what_was_only_what_the_model_looks_back_at_is_kept() -> None:
    seen = Observer(FeatureSet([STATE]), 3600.0)
    seen.look_back(2, 0.001)
    for step in range(100):
        seen.add("/arm", joint_state(["a", "b"], [step, 0.0], at_ns=step), step)
        time.sleep(0.0005)
    assert len(seen._past["/arm"]) < 20

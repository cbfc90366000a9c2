"""Several arms as one, from the description of a data set alone."""

from __future__ import annotations

from typing import Any

import pytest
from joshua_imitation.arms import joined_features

JOINTS = ["pan.pos", "gripper.pos"]
VECTOR: dict[str, Any] = {"dtype": "float32", "shape": [2], "names": JOINTS}
TWO: dict[str, Any] = {
    f"{key}.{arm}": VECTOR for key in ("observation.state", "action") for arm in ("left_arm", "right_arm")
}
PICTURE = {"observation.images.top": {"dtype": "video", "shape": [48, 64, 3], "names": None}}


def test_joints_of_one_name_get_the_part_that_differs() -> None:
    found, parts = joined_features({**TWO, **PICTURE})
    names = ["left_pan.pos", "left_gripper.pos", "right_pan.pos", "right_gripper.pos"]
    assert found == {
        **PICTURE,
        "observation.state": {**VECTOR, "shape": [4], "names": names},
        "action": {**VECTOR, "shape": [4], "names": names},
    }
    assert parts["action"] == ["action.left_arm", "action.right_arm"]


def test_joints_that_differ_keep_their_names() -> None:
    other = {**VECTOR, "names": ["yaw.pos", "hand.pos"]}
    described = {key: other if "right" in key else VECTOR for key, _ in TWO.items()}
    assert joined_features(described)[0]["action"]["names"] == [*JOINTS, "yaw.pos", "hand.pos"]


@pytest.mark.parametrize(
    "described",
    [
        {"observation.state": VECTOR, "action": VECTOR},
        {**TWO, "action": VECTOR},
        {key: values for key, values in TWO.items() if key != "observation.state.left_arm"},
        {key: values for key, values in TWO.items() if "left" in key},
        {**TWO, "action.left_arm": {**VECTOR, "names": None}},
        {**TWO, "action.left_arm": {**VECTOR, "unit": "rad"}},
    ],
)
def test_anything_else_stays_as_it_is(described: dict[str, Any]) -> None:
    assert joined_features(described) == (described, {})

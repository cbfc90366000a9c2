from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest
from joshua.features import ACTION, IMAGES, STATE, Feature, FeatureError, FeatureSet, checked

JOINTS = ("pan", "lift")
ROBOT = FeatureSet(
    [
        Feature.joints(STATE, JOINTS, topic="/arm/joint_states"),
        Feature.picture(f"{IMAGES}top", 48, 64, topic="/top/image_raw"),
        Feature.joints(ACTION, JOINTS),
    ]
)


def test_features_keep_their_order() -> None:
    assert list(ROBOT) == [STATE, "observation.images.top", ACTION]
    assert FeatureSet(ROBOT.values()) == ROBOT
    assert [feature.key for feature in ROBOT.pictures] == ["observation.images.top"]
    assert [feature.key for feature in ROBOT.numbers] == [STATE, ACTION]


def test_features_go_through_the_description_of_a_lerobot_data_set() -> None:
    again = FeatureSet.from_lerobot(json.loads(json.dumps(ROBOT.as_lerobot())))
    assert ROBOT.differences(again) == []
    assert ROBOT.as_lerobot()["observation.images.top"]["dtype"] == "video"


def test_features_of_data_sets_that_others_wrote() -> None:
    assert list(
        FeatureSet.from_lerobot(
            {
                "action": {"dtype": "float32", "shape": [2], "names": {"motors": ["pan.pos", "gripper.pos"]}},
                "observation.images.top": {
                    "dtype": "image",
                    "shape": [3, 48, 64],
                    "names": ["channels", "height", "width"],
                },
                "observation.state": {"dtype": "float32", "shape": [2], "names": None},
                "timestamp": {"dtype": "float32", "shape": [1], "names": None},
            }
        ).values()
    ) == [
        Feature.joints(ACTION, ("pan.pos", "gripper.pos"), unit="lerobot"),
        Feature.picture("observation.images.top", 48, 64),
        Feature(STATE, "float32", (2,)),
    ]


@pytest.mark.parametrize(
    "described",
    [{}, {"dtype": "float32"}, {"dtype": "video", "shape": [1]}, {"dtype": "a", "shape": 3}, [], None],
)
def test_what_describes_no_feature_is_refused(described: object) -> None:
    with pytest.raises(ValueError, match="action is no description of a feature"):
        FeatureSet.from_lerobot({ACTION: described})  # type: ignore[dict-item]


def test_two_features_of_one_key_are_refused() -> None:
    with pytest.raises(ValueError, match="two features are called action"):
        FeatureSet([ROBOT[ACTION], ROBOT[ACTION]])


def test_a_difference_is_named_feature_by_feature() -> None:
    other = FeatureSet(
        [
            Feature.joints(ACTION, ("pan", "elbow"), unit="deg", topic="/other"),
            Feature.joints(STATE, ("pan",)),
            Feature.picture(f"{IMAGES}wrist", 48, 64),
        ]
    )
    assert ROBOT.differences(other, here="of the robot", there="of the data set") == [
        "observation.images.top is of the robot and not of the data set",
        "observation.images.wrist is of the data set and not of the robot",
        "observation.state: shape (2,) of the robot and (1,) of the data set; "
        "names pan, lift of the robot and pan of the data set",
        "action: unit rad of the robot and deg of the data set; "
        "name 2 lift of the robot and elbow of the data set",
    ]
    assert ROBOT.differences(FeatureSet(list(ROBOT.values())[::-1])) == [], "the order does not count"


def test_values_are_checked_against_their_feature() -> None:
    assert checked(ROBOT[STATE], [1, 2]).dtype == np.float32
    picture = np.zeros((48, 64, 3), np.uint8)
    assert checked(ROBOT[f"{IMAGES}top"], picture) is picture
    assert checked(Feature("observation.scan", "float32", (0,)), [1.0] * 9).shape == (9,)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        (STATE, [1.0], r"observation.state has the shape \(1,\), and \(2,\) is kept \(pan, lift\)"),
        (STATE, ["a", "b"], "observation.state cannot be converted to float32"),
        (
            f"{IMAGES}top",
            np.zeros((48, 64), np.uint8),
            r"has the shape \(48, 64\), and \(48, 64, 3\) is kept$",
        ),
        (f"{IMAGES}top", np.zeros((48, 64, 3)), "has values of float64, but pictures are uint8"),
    ],
)
def test_values_that_do_not_fit_are_refused(key: str, value: object, message: str) -> None:
    with pytest.raises(FeatureError, match=message):
        checked(ROBOT[key], value)


def test_features_are_described_without_numpy() -> None:
    code = (
        "import sys; from joshua.features import FeatureSet, Feature; FeatureSet(); Feature.joints('a', ())"
    )
    subprocess.run([sys.executable, "-c", f"{code}; assert 'numpy' not in sys.modules"], check=True)

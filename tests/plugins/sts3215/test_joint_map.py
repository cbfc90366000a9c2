import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from joshua_servo.feedback import Feedback
from joshua_servo.joint_map import JointMap
from joshua_sts3215.settings import Sts3215Settings

CALIBRATION = {
    "motors": [
        {"id": 1, "joint_name": "pan", "range_min": 1000, "range_max": 3000},
        {"id": 2, "joint_name": "lift", "range_min": 500, "range_max": 2500, "inverted": True},
    ]
}


def make(**values: object) -> JointMap:
    return JointMap(
        Sts3215Settings.model_validate(
            {"port": "p", "motor_ids": [1, 2], "calibration": CALIBRATION, **values}
        )
    )


def test_2048_is_zero_and_an_inverted_joint_turns_the_other_way() -> None:
    joints = make()
    assert joints.radians([2048, 2048]).tolist() == [0.0, 0.0]
    assert joints.radians([3072, 3072]) == pytest.approx([np.pi / 2, -np.pi / 2])
    reading = Feedback(3072, 1024.0, 0.5, 12.0, 30, 0, False, 0.1)
    position, speed, load = joints.motion([reading, reading])
    assert position == pytest.approx([np.pi / 2, -np.pi / 2])
    assert speed == pytest.approx([np.pi / 2, -np.pi / 2])
    assert load.tolist() == [0.5, -0.5]


@given(st.tuples(st.integers(1000, 3000), st.integers(500, 2500)))
def test_ticks_survive_the_way_there_and_back(ticks: tuple[int, int]) -> None:
    joints = make()
    assert joints.ticks(joints.radians(ticks)) == list(ticks)


def test_limits_are_the_tightest_and_ordered() -> None:
    joints = make(position_min_ticks=1100)
    joints.tighten([0, 600], [2900, 4095])
    limits = joints.limits()
    assert (limits.position_min_rad < limits.position_max_rad).all()
    assert joints.radians([1100, 1100])[0] == pytest.approx(limits.position_min_rad[0])
    assert joints.radians([2900, 0])[0] == pytest.approx(limits.position_max_rad[0])
    assert joints.ticks([9.0, 9.0]) == [2900, 1100]
    assert joints.ticks([-9.0, -9.0]) == [1100, 2500]


def test_speed_is_the_configured_one_or_the_servos_own() -> None:
    assert make(velocity_ticks_s=1024).limits().velocity_max_rad_s == pytest.approx([np.pi / 2] * 2)
    assert make().limits().velocity_max_rad_s == pytest.approx([5.2155] * 2, abs=1e-3)

import itertools
import math

import pytest
from joshua_emulator.joint import Drive, Joint


def run(joint: Joint, drive: Drive, seconds: float, step_s: float = 0.001) -> list[float]:
    angles = []
    for index in range(round(seconds / step_s) + 1):
        joint.advance(100.0 + index * step_s, drive)
        angles.append(joint.angle)
    return angles


def test_a_move_ends_at_the_goal_within_speed_and_acceleration() -> None:
    angles = run(Joint(0.0), Drive("position", 1000.0, speed_limit=1000.0, acceleration=5000.0), 2.0)
    speeds = [(b - a) / 0.001 for a, b in itertools.pairwise(angles)]
    assert angles[-1] == 1000.0
    assert max(speeds) <= 1000.0 * 1.01
    assert max(speeds) >= 990.0
    assert max(abs(b - a) for a, b in itertools.pairwise(speeds) if b) <= 5000.0 * 0.001 * 4


def test_the_result_does_not_depend_on_how_often_it_is_looked_at() -> None:
    drive = Drive("position", 800.0, speed_limit=1500.0, acceleration=8000.0)
    fine, coarse = Joint(0.0), Joint(0.0)
    run(fine, drive, 0.3, 0.001)
    run(coarse, drive, 0.3, 0.1)
    assert coarse.angle == pytest.approx(fine.angle, abs=15.0)


def test_a_joint_without_power_stays_where_it_is_and_a_hand_moves_it() -> None:
    joint = Joint(500.0, 0.0, 4095.0)
    run(joint, Drive(), 0.5)
    assert joint.angle == 500.0
    joint.hand = lambda now_s: 500.0 + 1000.0 * (now_s - 100.5)
    joint.advance(101.0, Drive())
    assert joint.angle == pytest.approx(1000.0)
    assert joint.velocity == pytest.approx(1000.0)


def test_a_hand_cannot_pass_a_stop() -> None:
    joint = Joint(500.0, 100.0, 900.0)
    joint.hand = lambda _: 5000.0
    run(joint, Drive(), 0.01)
    assert joint.angle == 900.0


def test_a_blocked_joint_takes_the_load_that_its_limit_allows() -> None:
    joint = Joint(0.0)
    joint.blocked = True
    run(joint, Drive("position", 1000.0, torque_limit=0.6), 0.1)
    assert joint.angle == 0.0
    assert joint.load == pytest.approx(0.6)


def test_too_much_load_back_drives_the_joint() -> None:
    joint = Joint(0.0)
    joint.external_load = -0.5
    run(joint, Drive("position", 0.0, torque_limit=0.2), 0.5)
    assert joint.angle < -100.0
    held = Joint(0.0)
    held.external_load = -0.5
    run(held, Drive("position", 0.0, torque_limit=1.0), 0.5)
    assert held.angle == 0.0
    assert held.load == pytest.approx(0.5)


def test_load_heats_the_motor_and_rest_cools_it() -> None:
    joint = Joint(0.0)
    joint.blocked = True
    run(joint, Drive("position", 1000.0), 60.0, 1.0)
    hot = joint.temperature_c
    assert hot > 35.0
    for second in range(600):
        joint.advance(200.0 + second, Drive())
    assert joint.temperature_c < hot
    assert math.isclose(joint.temperature_c, 25.0, abs_tol=5.0)

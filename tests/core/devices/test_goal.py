from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from joshua.devices.actuator import JointLimits
from joshua.devices.goal import RAMP_SPEED_RAD_S, GoalGenerator, GoalState, SpeedScale
from joshua.devices.joint_command import JointCommand, TrajectoryCommand
from joshua.node.verbs import RefusedError

MS = 1_000_000
PERIOD_NS = 10 * MS


def limits(count: int = 2, speed: float = 5.0) -> JointLimits:
    return JointLimits(np.full(count, -2.0), np.full(count, 2.0), np.full(count, speed))


def command(*positions: float, indices: tuple[int, ...] | None = None) -> JointCommand:
    return JointCommand(np.array(indices or range(len(positions)), np.intp), np.array(positions))


class Loop:
    """A control loop of 100 Hz on a clock of its own."""

    def __init__(self, **options: Any) -> None:
        self.goals = GoalGenerator(limits(), 0.01, **options)
        self.now_ns = 0
        self.goals.seed(np.zeros(2))

    def run(self, cycles: int, *, send: JointCommand | None = None) -> np.ndarray[Any, Any]:
        goals = []
        for _ in range(cycles):
            if send is not None:
                self.goals.command(send, self.now_ns)
            self.now_ns += PERIOD_NS
            goals.append(self.goals.step(self.now_ns))
        return np.array(goals)


def test_without_a_command_the_joints_stay_where_they_were_found() -> None:
    loop = Loop()
    loop.goals.seed(np.array([0.3, -0.4]))
    assert (loop.run(100) == [0.3, -0.4]).all()
    assert loop.goals.state is GoalState.WAITING


def test_the_first_command_is_approached_slowly() -> None:
    loop = Loop()
    goals = loop.run(60, send=command(0.5, 0.1))
    speed = np.abs(np.diff(goals, axis=0, prepend=0.0)) / 0.01
    assert speed.max() <= RAMP_SPEED_RAD_S + 1e-9
    assert goals[-1] == pytest.approx([0.5, 0.1])
    assert goals[20] == pytest.approx([0.21, 0.1]), "each joint at its own time"
    assert not loop.goals.ramping


def test_after_the_approach_the_device_limits_the_speed() -> None:
    loop = Loop()
    loop.run(60, send=command(0.5, 0.0))
    goals = loop.run(10, send=command(1.5, 0.0))
    assert np.diff(goals[:, 0]).max() == pytest.approx(0.05)
    assert goals[-1][0] == pytest.approx(1.0)


def test_a_speed_scale_slows_the_approach_and_what_follows() -> None:
    loop = Loop()
    assert loop.goals.limit_speed(SpeedScale(0.5)) == "the joints use 50% of their speed limits"
    goals = loop.run(120, send=command(0.5, 0.0))
    assert np.diff(goals[:40, 0]).max() == pytest.approx(0.005)
    assert np.diff(loop.run(10, send=command(1.5, 0.0))[:, 0]).max() == pytest.approx(0.025)
    for scale in (0.0, -0.1, 1.01):
        with pytest.raises(RefusedError, match="must be above 0 and at most 1"):
            loop.goals.limit_speed(SpeedScale(scale))
    assert loop.goals.speed_scale_parameter == 0.5


def test_goals_stay_within_the_limits() -> None:
    assert Loop().run(500, send=command(99.0, -99.0))[-1] == pytest.approx([2.0, -2.0])


def test_a_partial_command_moves_only_the_joints_that_it_names() -> None:
    loop = Loop()
    loop.goals.seed(np.array([0.7, 0.0]))
    goals = loop.run(100, send=command(0.5, indices=(1,)))
    assert (goals[:, 0] == 0.7).all()
    assert goals[-1][1] == pytest.approx(0.5)


def test_joints_hold_when_commands_stop_and_approach_slowly_afterwards() -> None:
    loop = Loop(stale_after_s=0.5)
    loop.run(60, send=command(0.5, 0.5))
    assert loop.goals.state is GoalState.FOLLOWING
    loop.goals.command(command(1.9, 1.9), loop.now_ns)
    moving = loop.run(5)
    assert moving[-1][0] > 0.5
    loop.run(46)
    assert loop.goals.state is GoalState.HOLDING
    held = loop.run(100)
    assert (held == held[0]).all()
    again = loop.run(5, send=command(-1.0, -1.0))
    assert loop.goals.state is GoalState.FOLLOWING
    assert np.abs(np.diff(again, axis=0)).max() <= RAMP_SPEED_RAD_S * 0.01 + 1e-9


def test_a_long_cycle_does_not_make_a_long_step() -> None:
    loop = Loop()
    loop.run(60, send=command(0.5, 0.0))
    loop.goals.command(command(2.0, 0.0), loop.now_ns + 400 * MS)
    loop.now_ns += 400 * MS
    assert loop.goals.step(loop.now_ns)[0] == pytest.approx(0.5 + 2 * 0.05)


def test_a_trajectory_plays_to_its_end_and_stays_there() -> None:
    loop = Loop()
    loop.goals.play(TrajectoryCommand(np.array([1]), np.array([1.0]), np.array([[0.5]])), loop.now_ns)
    goals = loop.run(100)
    assert goals[49][1] == pytest.approx(0.25, abs=0.01)
    assert goals[-1] == pytest.approx([0.0, 0.5])
    assert (loop.run(200)[-1] == goals[-1]).all()
    assert loop.goals.state is GoalState.FOLLOWING, "an end is not a silence"


def test_a_trajectory_without_points_stops_the_joints() -> None:
    loop = Loop()
    loop.run(30, send=command(1.0, 1.0))
    loop.goals.play(TrajectoryCommand(np.zeros(0, np.intp), np.zeros(0), np.zeros((0, 0))), loop.now_ns)
    goals = loop.run(50)
    assert (goals == goals[0]).all()
    assert loop.goals.state is GoalState.HOLDING


def test_a_command_ends_a_trajectory() -> None:
    loop = Loop()
    loop.goals.play(TrajectoryCommand(np.array([0]), np.array([5.0]), np.array([[2.0]])), loop.now_ns)
    loop.run(20)
    assert loop.run(200, send=command(-0.5, 0.0))[-1][0] == pytest.approx(-0.5)


positions = st.floats(-1e6, 1e6)


@given(st.lists(st.tuples(positions, positions, st.integers(0, 1_000 * MS)), max_size=60))
def test_whatever_is_commanded_no_step_is_too_long(steps: list[tuple[float, float, int]]) -> None:
    goals = GoalGenerator(limits(), 0.01)
    goals.seed(np.zeros(2))
    now_ns, last = 0, np.zeros(2)
    for first, second, wait_ns in steps:
        goals.command(command(first, second), now_ns)
        now_ns += wait_ns
        goal = goals.step(now_ns)
        assert np.abs(goal - last).max() <= 5.0 * 0.02 + 1e-9
        assert np.abs(goal).max() <= 2.0
        last = goal

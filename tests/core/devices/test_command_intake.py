"""One commander at a time: who is admitted, who is refused, and how an override ends."""

from __future__ import annotations

import logging
import math
from typing import Any

import pytest
from commanded_arm import Arm
from joshua.devices.goal import GoalState
from joshua.messages.make import joint_state
from joshua.plan import Commander
from stepped_time import SteppedTime

LOG_NAME = "test_command_intake"
PLAN = (
    Commander("/leader", "/command"),
    Commander("/gamepad", "/command", override=True),
    Commander("/pedal", "/pedal", override=True),
)


@pytest.fixture
def log(caplog: pytest.LogCaptureFixture) -> Any:
    caplog.set_level("INFO")
    return logging.getLogger(LOG_NAME)


@pytest.fixture
def arm(stepped_time: SteppedTime, log: Any) -> Arm:
    return Arm(stepped_time, log, PLAN)


def test_the_named_leader_commands(arm: Arm, caplog: pytest.LogCaptureFixture) -> None:
    arm.send("/leader", 0.01)
    assert arm.step() == pytest.approx(0.01)
    assert (arm.commanders.current, arm.commanders.shown, caplog.messages) == ("/leader", "", [])
    assert len(arm.arrived) == 1


@pytest.mark.parametrize(
    ("publisher", "named"), [("/talker", "/talker"), ("", "a program that is not a ROS 2 node")]
)
def test_anyone_else_is_refused_named_once_and_counted(
    arm: Arm, publisher: str, named: str, caplog: pytest.LogCaptureFixture
) -> None:
    for _ in range(5):
        arm.send("/leader", 0.01)
        arm.send(publisher, 3.0)
        assert arm.step() == pytest.approx(0.01)
    arm.play(publisher, 3.0, 1)
    assert arm.step() == pytest.approx(0.01)
    assert arm.commanders.refused == {publisher: 6}
    assert arm.commanders.shown == f"6 commands refused from {named}"
    assert caplog.messages == [
        f"/command: commands from {named} are refused: the configuration does not name it as a commander. To "
        "accept commands from outside the file, set external: true on this subscription"
    ]
    assert len(arm.arrived) == 5


def test_a_commander_counts_on_its_own_topic_only(arm: Arm) -> None:
    arm.send("/leader", 1.0, topic="/pedal")
    arm.send("/gamepad", 1.0, topic="/pedal")
    assert arm.step() == 0
    assert arm.commanders.refused == {"/leader": 1, "/gamepad": 1}


def test_only_one_of_many_external_nodes_commands_at_a_time(
    stepped_time: SteppedTime, log: Any, caplog: pytest.LogCaptureFixture
) -> None:
    arm = Arm(stepped_time, log, (), ("/command",))
    for _ in range(5):
        arm.send("/moveit", 0.01)
        arm.send("/talker", 3.0)
        assert arm.step() == pytest.approx(0.01)
    assert caplog.messages == ["/command: commands from /talker are refused: /moveit is the commander"]
    arm.step(0.5)
    arm.send("/talker", 3.0)
    assert arm.step() == pytest.approx(0.03), "approached at 1 rad/s"
    assert arm.commanders.current == "/talker"


def test_what_is_remembered_of_strangers_is_bounded(arm: Arm) -> None:
    for number in range(300):
        arm.send(f"/stranger{number}", 1.0)
    assert len(arm.commanders.refused) == 101
    assert sum(arm.commanders.refused.values()) == 300
    assert arm.commanders.shown.startswith("300 commands refused from /stranger0, /stranger1, /stranger2, …")


@pytest.mark.parametrize("silent_s", [0.5, 60.0])
def test_an_override_that_stops_holds_the_joints_and_never_returns_control(
    arm: Arm, silent_s: float, caplog: pytest.LogCaptureFixture
) -> None:
    arm.send("/leader", 0.0)
    for _ in range(10):
        arm.send("/gamepad", 3.0)
        at = arm.step()
    held = arm.step(0.16)
    assert not arm.commanders.held
    assert at < held < 0.5
    arm.step(0.04)
    assert arm.commanders.held
    assert arm.goals.state is GoalState.HOLDING
    held = arm.step()
    for _ in range(round(silent_s / 0.02)):
        arm.send("/leader", 0.0)
        assert arm.step() == held
    assert arm.commanders.shown == "override /gamepad stopped publishing: holding"
    assert caplog.messages == [
        "/gamepad overrides: commands of other nodes are ignored",
        "the override /gamepad stopped publishing: the joints hold their position. Press its release button "
        "or run `joshua call NODE release_override` to return control",
    ]
    assert arm.commanders.refused == {}, "the leader is no stranger"
    assert arm.commanders.release() == "/gamepad"
    assert arm.step() == held, "released, and no command yet"
    arm.send("/leader", 0.0)
    assert arm.step() == pytest.approx(held - 0.02), "the leader is approached at 1 rad/s"
    assert caplog.messages[-1] == "the override /gamepad is released: other commanders have control again"
    assert arm.commanders.release() == ""


def test_an_override_that_publishes_again_has_control_again(arm: Arm) -> None:
    arm.send("/gamepad", 0.0)
    arm.step(0.3)
    assert arm.commanders.held
    arm.send("/gamepad", 3.0)
    assert arm.step() == pytest.approx(0.02), "approached slowly"
    assert arm.commanders.shown == "override /gamepad commands"


def test_a_message_without_joints_is_the_release_button(arm: Arm) -> None:
    arm.send("/gamepad", 1.0)
    arm.step()
    arm.send("/pedal", None, topic="/pedal")
    assert arm.commanders.overriding, "only the override itself can do that"
    arm.send("/gamepad", None)
    assert not arm.commanders.overriding
    arm.send("/leader", 0.0)
    assert arm.commanders.current == "/leader"
    arm.send("/leader", None)
    assert arm.commanders.current == "/leader"


def test_another_override_takes_control_from_the_first(arm: Arm) -> None:
    arm.send("/gamepad", 1.0)
    arm.send("/pedal", 0.0, topic="/pedal")
    assert arm.commanders.current == "/pedal"


def test_a_trajectory_of_the_override_counts_as_publishing(arm: Arm) -> None:
    arm.play("/gamepad", 1.0, 2)
    arm.send("/leader", 0.0)
    arm.step(2.1)
    assert not arm.commanders.held
    assert arm.step(0.2) == pytest.approx(1.0, abs=0.01)
    assert arm.commanders.held


@pytest.fixture
def guided(stepped_time: SteppedTime, log: Any) -> Arm:
    """An arm with a model, and a leader arm that overrides by moving."""
    guide = Commander("/guide", "/command", override=True, motion_rad=0.1)
    return Arm(stepped_time, log, (Commander("/model", "/command"), guide))


def test_a_leader_that_lies_still_leaves_control_to_the_model(guided: Arm) -> None:
    for cycle in range(50):
        guided.send("/guide", 2.0 + 0.09 * (cycle % 2))  # where it lies, and what shakes it
        guided.send("/model", 0.01)
        assert guided.step() == pytest.approx(0.01)
    guided.send("/guide", math.nan)
    guided.send("/model", 0.01)
    assert guided.step() == pytest.approx(0.01)
    assert guided.commanders.current == "/model"
    assert guided.commanders.refused == {}
    assert len(guided.arrived) == 51, "none of the leader's messages was executed"


def test_a_leader_that_is_moved_takes_control_without_a_jump_and_gives_it_back_by_an_act_only(
    guided: Arm, caplog: pytest.LogCaptureFixture
) -> None:
    guided.send("/guide", 2.0)
    guided.send("/model", 0.0)
    before = guided.step()
    for cycle in range(20):  # slowly: the distance decides
        guided.send("/guide", 2.0 + 0.012 * cycle)
        guided.send("/model", 0.0)
        now = guided.step()
        assert abs(now - before) <= 0.02 + 1e-9, "approached at 1 rad/s"
        before = now
    assert guided.commanders.overriding
    assert before == pytest.approx(11 * 0.02), "since it was 0.108 rad away"
    for _ in range(10):  # it lies still again, and keeps control
        guided.send("/guide", 2.228)
        guided.send("/model", 0.0)
        now = guided.step()
    assert now > before
    assert guided.commanders.releasable
    assert guided.commanders.release() == "/guide"
    for _ in range(10):
        guided.send("/guide", 2.228)
        guided.send("/model", 0.0)
        before, now = now, guided.step()
        assert now == pytest.approx(before - 0.02), "the model is approached at 1 rad/s"
    assert guided.commanders.current == "/model"
    guided.send("/guide", 2.33)
    assert guided.commanders.current == "/guide"
    assert caplog.text.count("/guide overrides: commands of other nodes are ignored") == 2


def test_a_leader_with_other_joints_than_before_lies_where_it_is(guided: Arm) -> None:
    guided.send("/guide", 0.0)
    guided.intake.joint_state(guided.readers["/command"], joint_state(["a", "b"], [1.0, 1.0]), "/guide")
    assert guided.commanders.current is None
    guided.intake.joint_state(guided.readers["/command"], joint_state(["a", "b"], [1.0, 1.2]), "/guide")
    assert guided.commanders.current == "/guide"


FAULT = "joint_1: 81 °C, at most 70 °C. Run `joshua resume arm` to re-enable torque"


def test_commands_in_a_fault_have_no_effect_and_their_publisher_is_named_once_for_each_fault(
    arm: Arm, caplog: pytest.LogCaptureFixture
) -> None:
    arm.send("/leader", 0.01)
    arm.fault = FAULT
    for _ in range(3):
        arm.send("/leader", 0.02)
        arm.send("/gamepad", 3.0)
        arm.play("/gamepad", 3.0, 1)
        arm.step()
    assert arm.commanders.current == "/leader"
    assert len(arm.arrived) == 1
    said = [f"/command: commands from {name} have no effect: {FAULT}" for name in ("/leader", "/gamepad")]
    assert caplog.messages == said
    assert arm.commanders.shown == "9 commands without effect from /leader, /gamepad"
    arm.fault = ""
    arm.commanders.forget_ignored()
    assert arm.commanders.shown == ""
    arm.send("/leader", 0.02)
    assert len(arm.arrived) == 2
    arm.fault = FAULT
    arm.send("/leader", 0.02)
    assert caplog.messages == [*said, said[0]], "in the next fault again"


def test_an_override_that_publishes_through_a_fault_is_not_reported_as_stopped(
    arm: Arm, caplog: pytest.LogCaptureFixture
) -> None:
    arm.send("/gamepad", 1.0)
    arm.fault = FAULT
    for _ in range(100):
        arm.send("/gamepad", 1.0)
        arm.step()
    assert not arm.commanders.held
    assert not any("stopped publishing" in text for text in caplog.messages)
    arm.step(0.3)
    assert arm.commanders.held
    arm.send("/gamepad", 1.0)
    assert arm.commanders.held, "its command is not executed"
    arm.fault = ""
    arm.send("/gamepad", 1.0)
    assert not arm.commanders.held


def test_publishers_without_effect_are_bounded(arm: Arm) -> None:
    arm = Arm(arm.clock, logging.getLogger(LOG_NAME), (), ("/command",))
    arm.fault = FAULT
    for number in range(300):
        arm.send(f"/stranger{number}", 1.0)
    assert len(arm.commanders.ignored) == 101


def test_a_gamepad_that_publishes_cannot_be_released(arm: Arm) -> None:
    arm.send("/gamepad", 1.0)
    assert not arm.commanders.releasable

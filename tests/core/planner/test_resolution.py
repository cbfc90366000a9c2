"""What the plan says about safe states."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from joshua.plan import ActuatorFacts, OnStale, SafeStop
from joshua.planner.pipeline import PipelineResult, examine
from joshua.planner.request import Request

FILE = """
general {{ mode: MODE_TEST name: "rig" id: "rig-1" }}
robot {{ actions {{
  node {{
    node_name: "arm" node_id: 1
    publishers {{ data_type: JOINT_STATE topic_name: "/arm/joint_states" publish_rate_hz: 50 }}
    {subscription}
  }}
  action_type: {role}
  {block}
  {more}
}} }}
"""
SERVOS = """sts3215_config {
    comm { serial { port: "/dev/ttyACM0" baudrate: 1000000 } } motor_ids: [1, 2] position_max: 4095
  }"""
MOCK = "mock_motor_config { num_motors: 2 position_max: 4095 }"
PARK = "safe_state: PARK_THEN_RELEASE"


SUBSCRIPTION = 'subscriptions { data_type: JOINT_STATE topic_name: "/commands" }'


def planned(
    folder: Path,
    more: str,
    *,
    block: str = SERVOS,
    role: str = "ACTION_FOLLOWER",
    commanded: bool = False,
) -> PipelineResult:
    path = folder / "robot.pbtxt"
    subscription = SUBSCRIPTION if commanded else ""
    path.write_text(FILE.format(role=role, block=block, more=more, subscription=subscription))
    return examine(Request(str(path)))


def facts(examination: PipelineResult) -> ActuatorFacts:
    assert examination.plan is not None, examination.diagnostics
    (node,) = examination.plan.nodes
    return node.facts_as(ActuatorFacts)


def finding(examination: PipelineResult, code: str) -> Any:
    (item,) = [item for item in examination.diagnostics if item.code == code]
    return item


def test_an_arm_is_held_by_default(tmp_path: Path) -> None:
    stop = facts(planned(tmp_path, "")).safe_stop
    assert stop == SafeStop("joshua_sts3215.safe_stop:Sts3215StopRequest", "HOLD", (), 5.0)


def test_parking_asks_the_stop_for_more_time(tmp_path: Path) -> None:
    values = facts(planned(tmp_path, f"{PARK} park_pose_rad: [0.5, -0.5] park_timeout_s: 8"))
    assert values.safe_stop.park_pose_rad == (0.5, -0.5)
    assert values.stop_timeout_s > 8


def test_a_leader_is_released_and_has_no_guardian(tmp_path: Path) -> None:
    values = facts(planned(tmp_path, "", role="ACTION_LEADER"))
    assert values.safe_state == "RELEASE"
    assert values.safe_stop is None


def test_a_device_that_nothing_stops_is_told_apart(tmp_path: Path) -> None:
    assert not facts(planned(tmp_path, "")).keeps_last_goal
    assert not facts(planned(tmp_path, "", block=MOCK)).keeps_last_goal


def test_virtual_motors_have_no_guardian(tmp_path: Path) -> None:
    examination = planned(tmp_path, "safe_state: RELEASE park_timeout_s: 3", block=MOCK)
    assert facts(examination).safe_state == "RELEASE"
    assert facts(examination).safe_stop is None
    assert "arm has no guardian whose time it could limit" in finding(examination, "field-unused").message


def test_virtual_motors_cannot_park(tmp_path: Path) -> None:
    item = finding(planned(tmp_path, f"{PARK} park_pose_rad: [0, 0]", block=MOCK), "safe-state-unfit")
    assert item.message == "arm: the plugin of mock_motor_config cannot park."
    assert item.allowed == ("HOLD", "RELEASE")
    assert item.position is not None


def test_a_park_pose_has_one_angle_for_each_joint(tmp_path: Path) -> None:
    item = finding(planned(tmp_path, f"{PARK} park_pose_rad: [0, 0, 0]"), "park-pose-unfit")
    assert "has 3 angles, but the actuator has 2 joints: joint_1, joint_2" in item.message
    assert item.allowed == ("2 angles",)


def test_a_policy_for_commands_that_stay_away_reaches_the_node(tmp_path: Path) -> None:
    assert facts(planned(tmp_path, "on_stale: HOLD")).on_stale is None
    more = "on_stale: PARK_THEN_RELEASE on_stale_after_s: 1.5 park_pose_rad: [0.5, -0.5]"
    on_stale = facts(planned(tmp_path, more, block=MOCK)).on_stale
    assert on_stale == OnStale("PARK_THEN_RELEASE", 1.5, (0.5, -0.5), 5.0)
    item = finding(planned(tmp_path, "on_stale: PARK_THEN_RELEASE park_pose_rad: [0]"), "park-pose-unfit")
    assert "has 1 angles" in item.message


def test_settings_about_commands_that_have_no_effect_are_named(tmp_path: Path) -> None:
    for role in ("ACTION_LEADER", "ACTION_FOLLOWER"):  # neither has a subscription
        item = finding(planned(tmp_path, "on_stale: RELEASE", role=role), "field-unused")
        assert item.message == "on_stale has no effect: the actuator follows no commands."
    holds = finding(planned(tmp_path, "on_stale_after_s: 3", commanded=True), "field-unused")
    assert holds.message == "on_stale_after_s has no effect: holding joints keep their position."
    assert "on_stale: RELEASE" in holds.remedy
    parks = planned(tmp_path, "on_stale: PARK_THEN_RELEASE", commanded=True)
    missing = finding(parks, "park-pose-missing")
    assert missing.field_path.endswith(".on_stale")


def test_the_limit_of_a_hang_comes_from_the_file(tmp_path: Path) -> None:
    assert facts(planned(tmp_path, "hang_after_s: 0.75")).hang_after_s == 0.75
    assert facts(planned(tmp_path, "")).hang_after_s == 0.0
    assert planned(tmp_path, "hang_after_s: 0.05").plan is None

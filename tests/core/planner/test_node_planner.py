"""What the plan tells a node of the others."""

from pathlib import Path

import pytest
from joshua.config import load
from joshua.modes.services import DATA_STORE
from joshua.plan import Commander, Severity
from joshua.plan.graph import GraphService
from joshua.planner.node_planner import commanders
from joshua.planner.pipeline import examine
from joshua.planner.request import Request

GENERAL = 'general { mode: MODE_TELEOPERATE name: "rig" id: "rig-1" }\n'

LEADER = """
  actions {
    node {
      node_name: "leader" node_id: 1 node_type: PYTHON
      publishers { data_type: JOINT_STATE topic_name: "/leader/joint_states" publish_rate_hz: 50 }
    }
    action_type: ACTION_LEADER
    mock_motor_config { num_motors: 2 position_min: 1024 position_max: 3072 }
  }
"""

FOLLOWER = """
  actions {
    node {
      node_name: "follower" node_id: 2 node_type: PYTHON
      qos { depth: 3 }
      publishers { data_type: JOINT_STATE topic_name: "/follower/joint_states" publish_rate_hz: 50 }
      subscriptions { data_type: JOINT_STATE topic_name: "/leader/joint_states" }
    }
    action_type: ACTION_FOLLOWER
    mock_motor_config { num_motors: 2 position_max: 4095 }
  }
"""


def write(folder: Path, text: str) -> str:
    path = folder / "robot.pbtxt"
    path.write_text(text)
    return str(path)


def teleoperation(folder: Path, more: str = "", *, general: str = GENERAL) -> str:
    return write(folder, f"{general}robot {{ {FOLLOWER} {LEADER} }}\n{more}")


def test_a_follower_knows_its_leader_and_both_know_their_joints(tmp_path):
    leader, follower = examine(Request(teleoperation(tmp_path))).plan.nodes
    assert [joint.name for joint in leader.facts.joints] == ["joint_1", "joint_2"]
    low = leader.facts.joints[0].min_rad
    assert low == pytest.approx((1024 - 2048) * 2 * 3.141592653589793 / 4096)
    assert follower.facts.commanders[0].node == "/leader"
    assert follower.facts.commanders[0].topic == "/leader/joint_states"
    assert follower.facts.commanders[0].joints == leader.facts.joints
    assert leader.facts.commanders == ()


def test_a_calibration_names_the_joints(tmp_path):
    calibration = """
calibration { arms { node_name: "leader"
  motors { id: 1 joint_name: "shoulder_pan" range_min: 100 range_max: 4000 }
  motors { id: 2 joint_name: "gripper" range_min: 200 range_max: 3000 } } }
"""
    leader, follower = examine(Request(teleoperation(tmp_path, calibration))).plan.nodes
    assert [joint.name for joint in leader.facts.joints] == ["shoulder_pan", "gripper"]
    assert [joint.name for joint in follower.facts.commanders[0].joints] == ["shoulder_pan", "gripper"]


def test_a_calibration_of_the_robot_is_judged_once_and_where_it_stands(tmp_path):
    path = Path(teleoperation(tmp_path))
    folder = tmp_path / "calibration"
    folder.mkdir()
    (folder / "rig-1.pbtxt").write_text("""calibration {
  arms { node_name: "leader"
    motors { id: 1 joint_name: "pan" range_min: 100 range_max: 4368 }
    motors { id: 2 joint_name: "grip" range_min: 200 range_max: 3000 } }
  arms { node_name: "leder"
    motors { id: 1 joint_name: "pan" range_min: 100 range_max: 4000 } }
}
""")
    error, note = examine(Request(str(path))).diagnostics
    assert (error.code, error.severity) == ("out-of-range", Severity.ERROR)
    assert error.field_path == "calibration.arms[0].motors[0].range_max"
    assert str(error.position) == f"{folder / 'rig-1.pbtxt'}:3:64"
    assert (note.code, note.severity) == ("calibration-unknown-node", Severity.NOTE)
    assert note.allowed[0] == '"leader"'


def test_an_actuator_knows_who_may_take_over(tmp_path):
    path = teleoperation(tmp_path)
    second = """actions {
    node { node_name: "second" node_id: 7
      publishers { data_type: JOINT_STATE topic_name: "/leader/joint_states" publish_rate_hz: 50
        override: true } }
    action_type: ACTION_LEADER
    mock_motor_config { num_motors: 2 position_max: 4095 } }
"""
    text = Path(path).read_text()
    Path(path).write_text(text.replace("robot {", "robot { " + second, 1))
    nodes = {node.name: node for node in examine(Request(path)).plan.nodes}
    leader, other, follower = (nodes[name] for name in ("leader", "second", "follower"))
    assert follower.facts.commanders == (
        Commander("/second", "/leader/joint_states", other.facts.joints, override=True, motion_rad=0.1),
        Commander("/leader", "/leader/joint_states", leader.facts.joints),
    )
    assert leader.facts.commanders == ()
    text = Path(path).read_text()
    Path(path).write_text(text.replace("override: true", "override: true override_motion_rad: 0"))
    follower = next(node for node in examine(Request(path)).plan.nodes if node.name == "follower")
    assert follower.facts.commanders[0].motion_rad == 0


def test_the_motion_of_an_override_belongs_to_a_leader_that_overrides(tmp_path):
    path = teleoperation(tmp_path)
    text = Path(path).read_text()
    rate = 'topic_name: "/leader/joint_states" publish_rate_hz: 50'
    Path(path).write_text(text.replace(rate, f"{rate} override_motion_rad: 0.2"))
    (note,) = (item for item in examine(Request(path)).diagnostics if item.code == "field-unused")
    assert note.field_path == "robot.actions[1].node.publishers[0].override_motion_rad"
    assert note.message == (
        "override_motion_rad has no effect: it belongs to a leader arm with override: true."
    )


def test_nodes_outside_the_file_command_an_external_follower_without_a_leader(tmp_path):
    follower = FOLLOWER.replace(
        'topic_name: "/leader/joint_states" }',
        'topic_name: "/moveit/joint_commands" external: true }\n'
        '      subscriptions { data_type: JOINT_TRAJECTORY topic_name: "/moveit/trajectory" external: true }',
    )
    result = examine(Request(write(tmp_path, f"{GENERAL}robot {{ {follower} }}")))
    assert not result.diagnostics
    (node,) = result.plan.nodes
    assert node.facts.external == ("/moveit/joint_commands", "/moveit/trajectory")
    assert node.facts.commanders == ()


def test_a_replay_commands_and_a_model_that_does_not_run_does_not(tmp_path):
    store = """ai { data_store { format: FORMAT_CSV storage: STORAGE_LOCAL operation: DATA_STORE_REPLAY
  dataset_name: "pick" local_path: "." }
  models { node { node_name: "policy" node_id: 9
    publishers { data_type: JOINT_STATE topic_name: "/leader/joint_states" publish_rate_hz: 10 } }
    model_type: RANDOM_NOISE } }"""
    general = GENERAL.replace("MODE_TELEOPERATE", "MODE_DATA_STORE")
    loaded = load(write(tmp_path, f"{general}robot {{ {FOLLOWER} }}\n{store}"))
    topics = tuple(DATA_STORE.topics(loaded.graph, loaded.config))
    graph = loaded.graph.with_services([GraphService("data_store", "ai.data_store", topics)])
    (follower,) = graph.actuators
    replay = Commander("/data_store", "/leader/joint_states")
    assert list(commanders(graph, follower, {}, models=False)) == [replay]
    model = Commander("/policy", "/leader/joint_states")
    assert list(commanders(graph, follower, {}, models=True)) == [model, replay]

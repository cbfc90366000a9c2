"""What the operation modes accept, beside what the corpus of broken files shows."""

from __future__ import annotations

from pathlib import Path

import pytest
from joshua.config import load
from joshua.modes import check_mode
from joshua.schema import config_pb2 as pb

LEADER = """actions { node { node_name: "leader" node_id: 1
  publishers { data_type: JOINT_STATE topic_name: "/lead" publish_rate_hz: 50 } }
  action_type: ACTION_LEADER mock_motor_config { num_motors: 6 position_max: 4095 } }"""
FOLLOWER = """actions { node { node_name: "follower" node_id: 2
  subscriptions { data_type: JOINT_STATE topic_name: "/lead" } }
  action_type: ACTION_FOLLOWER mock_motor_config { num_motors: 6 position_max: 4095 } }"""
KEYBOARD = """perceptions { node { node_name: "keyboard" node_id: 3
  publishers { data_type: %s topic_name: "/lead" publish_rate_hz: 50 } }
  perception_type: PERCEPTION_KEYBOARD keyboard_config { } }"""
CAMERA = """perceptions { node { node_name: "camera" node_id: 4
  publishers { data_type: IMAGE topic_name: "/image" publish_rate_hz: 30 } }
  perception_type: PERCEPTION_CAMERA mock_camera_config { width: 640 height: 480 fps: 30 } }"""
MODEL = """models { model_type: RANDOM_NOISE node { node_name: "policy" node_id: 5
  publishers { data_type: JOINT_STATE topic_name: "/lead" publish_rate_hz: 10 } } }"""


def codes(tmp_path: Path, mode: str, robot: str = "", ai: str = "", rest: str = "") -> list[str]:
    path = tmp_path / "robot.pbtxt"
    path.write_text(
        f'general {{ mode: {mode} id: "x" }} robot {{ {robot} }} ai {{ {ai} }} {rest}', encoding="utf-8"
    )
    loaded = load(str(path))
    assert loaded.diagnostics == []
    return [item.code for item in check_mode(loaded)]


@pytest.mark.parametrize(
    ("robot", "ai", "expected"),
    [
        (LEADER + FOLLOWER, "", []),
        (KEYBOARD % "JOINT_STATE" + FOLLOWER, "", []),
        (FOLLOWER, MODEL, ["mode-lacks-leader", "block-unused"]),
        (LEADER + FOLLOWER, MODEL, ["block-unused"]),
        (
            LEADER + FOLLOWER.replace("/lead", "/ai"),
            MODEL.replace("/lead", "/ai"),
            ["follower-without-leader", "block-unused"],
        ),
        (KEYBOARD % "JOY" + FOLLOWER, "", ["mode-lacks-leader"]),
        (LEADER + FOLLOWER.replace("ACTION_FOLLOWER", "ACTION_SINGLE"), "", []),
        (LEADER + FOLLOWER + FOLLOWER.replace("/lead", "/led"), "", ["follower-without-leader"]),
        (
            LEADER + FOLLOWER + FOLLOWER.replace("/lead", "/led").replace("ACTION_FOLLOWER", "ACTION_SINGLE"),
            "",
            ["topic-unpublished"],
        ),
        ("", "", ["mode-lacks-leader", "mode-lacks-follower"]),
    ],
)
def test_teleoperation(robot: str, ai: str, expected: list[str], tmp_path: Path) -> None:
    assert codes(tmp_path, "MODE_TELEOPERATE", robot, ai) == expected


@pytest.mark.parametrize(
    ("robot", "expected"),
    [
        (FOLLOWER, []),
        (FOLLOWER + CAMERA, []),
        (FOLLOWER + FOLLOWER.replace("/lead", "/led"), ["topic-unpublished"]),
        (FOLLOWER.replace("/lead", "/led"), ["model-drives-nothing"]),
        (CAMERA, ["mode-lacks-actuator"]),
    ],
)
def test_inference(robot: str, expected: list[str], tmp_path: Path) -> None:
    assert codes(tmp_path, "MODE_INFERENCE", robot, MODEL) == expected


@pytest.mark.parametrize(("robot", "ai"), [(LEADER, ""), (CAMERA, ""), ("", MODEL)])
def test_anything_can_be_tested(robot: str, ai: str, tmp_path: Path) -> None:
    assert codes(tmp_path, "MODE_TEST", robot, ai) == []


@pytest.mark.parametrize("mode", ["MODE_TELEOPERATE", "MODE_TEST"])
def test_a_follower_with_other_joints_than_its_leader_is_noticed(mode: str, tmp_path: Path) -> None:
    robot = LEADER + FOLLOWER.replace("num_motors: 6", "num_motors: 5")
    assert codes(tmp_path, mode, robot) == ["joint-count-mismatch"]


RECORD = 'data_store { format: FORMAT_CSV storage: %s dataset_name: "d" %s }'


@pytest.mark.parametrize(
    ("store", "robot", "expected"),
    [
        (RECORD % ("STORAGE_LOCAL", 'local_path: "d"'), CAMERA, []),
        (RECORD % ("STORAGE_LOCAL", ""), CAMERA, ["mode-lacks-field"]),
        (RECORD % ("STORAGE_CLOUD", 'remote_url: "hf://datasets/a/b"'), CAMERA, []),
        (
            RECORD % ("STORAGE_CLOUD", 'remote_url: "hf://datasets/a/b" operation: DATA_STORE_REPLAY'),
            FOLLOWER,
            [],
        ),
        (
            RECORD % ("STORAGE_LOCAL", 'local_path: "d" operation: DATA_STORE_REPLAY'),
            LEADER,
            ["mode-lacks-actuator"],
        ),
        (
            RECORD
            % (
                "STORAGE_CLOUD",
                'local_path: "d" remote_url: "hf://datasets/a/b" operation: DATA_STORE_UPLOAD',
            ),
            "",
            [],
        ),
    ],
)
def test_data_store(store: str, robot: str, expected: list[str], tmp_path: Path) -> None:
    assert codes(tmp_path, "MODE_DATA_STORE", robot, store) == expected


SIMULATION = 'simulation { mode: %s model_path: "x.xml" %s }'
MAPPING = 'mirror_topic_mappings { ros_topic: "%s" mujoco_actuator: "j" }'


@pytest.mark.parametrize(
    ("simulation", "ai", "expected"),
    [
        (SIMULATION % ("INTERACTIVE", ""), "", []),
        (SIMULATION % ("OFFSCREEN", ""), "", []),
        (
            SIMULATION % ("OFFSCREEN", "generate { count: 1 }"),
            RECORD % ("STORAGE_LOCAL", 'local_path: "d"'),
            [],
        ),
        (
            SIMULATION % ("OFFSCREEN", "generate { count: 1 }"),
            RECORD % ("STORAGE_CLOUD", 'local_path: "d" remote_url: "s3://b/d"'),
            ["not-allowed"],
        ),
        (SIMULATION % ("PASSIVE", ""), "", ["mode-lacks-block"]),
        (SIMULATION % ("PASSIVE", ""), RECORD % ("STORAGE_LOCAL", 'local_path: "d"'), []),
        (SIMULATION % ("MIRROR", MAPPING % "/lead"), "", []),
        (SIMULATION % ("MIRROR", MAPPING % "/laed"), "", ["mapping-unpublished"]),
        (SIMULATION % ("MIRROR", MAPPING % "/image"), "", ["mapping-type"]),
        (SIMULATION % ("MIRROR", ""), "", ["mode-lacks-block"]),
        (SIMULATION % ("PASSIVE", ""), RECORD % ("STORAGE_LOCAL", ""), ["mode-lacks-field"]),
        (
            SIMULATION % ("PASSIVE", MAPPING % "/lead"),
            RECORD % ("STORAGE_LOCAL", 'local_path: "d"'),
            ["block-unused"],
        ),
    ],
)
def test_simulation(simulation: str, ai: str, expected: list[str], tmp_path: Path) -> None:
    assert codes(tmp_path, "MODE_SIMULATION", LEADER + CAMERA, ai, simulation) == expected


TRAIN = "training { environment: %s method: %s %s }"


@pytest.mark.parametrize(
    ("training", "robot", "expected"),
    [
        (TRAIN % ("ENV_REAL", "METHOD_RL", ""), "", []),  # which trainers refuse, and an arm would not help
        (TRAIN % ("ENV_SIMULATION", "METHOD_RL", ""), FOLLOWER, ["block-unused"]),
        (
            TRAIN % ("ENV_REAL", "METHOD_IMITATION", 'imitation_config { dataset_name: "d" }'),
            "",
            ["mode-lacks-model", "mode-lacks-actuator"],
        ),
        ("", "", ["mode-lacks-block"]),
    ],
)
def test_training(training: str, robot: str, expected: list[str], tmp_path: Path) -> None:
    assert codes(tmp_path, "MODE_TRAINING", robot, training) == expected


def test_a_file_without_a_mode_has_no_findings_here(tmp_path: Path) -> None:
    path = tmp_path / "robot.pbtxt"
    path.write_text(f"robot {{ {FOLLOWER} }}", encoding="utf-8")
    assert check_mode(load(str(path))) == []


def test_every_mode_has_its_checks(tmp_path: Path) -> None:
    for value in pb.OperationMode.DESCRIPTOR.values[1:]:
        assert all(code.startswith("mode-lacks-") for code in codes(tmp_path, value.name))


@pytest.mark.parametrize(
    ("mode", "block", "expected"),
    [
        ("MODE_TEST", "test { duration_s: 1 }", []),
        ("MODE_TEST", "calibration_run { }", ["block-unused"]),
        ("MODE_TEST", SIMULATION % ("OFFSCREEN", ""), []),
    ],
)
def test_blocks_without_effect_are_noted(mode: str, block: str, expected: list[str], tmp_path: Path) -> None:
    arm = """actions { node { node_name: "a" node_id: 1 } action_type: ACTION_SINGLE
      sts3215_config { motor_ids: 1 position_max: 1 } }"""
    assert codes(tmp_path, mode, arm, rest=block) == expected

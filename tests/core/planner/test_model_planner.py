"""What a model needs of the robot is compared with it before the launch."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest
from joshua.plan import ModelArm, ModelFacts
from joshua.planner.pipeline import PipelineResult, examine
from joshua.planner.request import Request

TOY = Path(__file__).parents[2] / "support/toy_policy"
FILE = """
general { mode: MODE_INFERENCE name: "rig" id: "rig-1" }
robot {
  actions { node { node_name: "arm" node_id: 1
      publishers { data_type: JOINT_STATE topic_name: "/arm/joint_states" publish_rate_hz: 50 }
      subscriptions { data_type: JOINT_STATE topic_name: "/ai/actions" } }
    action_type: ACTION_MOCK mock_motor_config { num_motors: 2 position_max: 4095 } }
  perceptions { node { node_name: "camera_top" node_id: 2
      publishers { data_type: IMAGE topic_name: "/camera/top/image_raw" publish_rate_hz: 10 } }
    perception_type: PERCEPTION_CAMERA mock_camera_config { width: 64 height: 48 fps: 10 } }
  %(robot)s
}
ai { models {
  model_type: MODEL_PLUGIN
  node { node_name: "policy" node_id: 3 %(host)s
    publishers { data_type: JOINT_STATE topic_name: "/ai/actions" publish_rate_hz: 30 }
    subscriptions { data_type: IMAGE topic_name: "/camera/top/image_raw" } }
  plugin_config { [type.example.org/toy.PolicyConfig] { %(block)s } }
  %(entry)s
} }
"""
LEADER = """actions { node { node_name: "guide" node_id: 9
      publishers { data_type: JOINT_STATE topic_name: "/ai/actions" publish_rate_hz: 50 override: true } }
    action_type: ACTION_LEADER mock_motor_config { num_motors: 2 position_max: 4095 } }"""


@pytest.fixture
def robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(TOY))

    def examined(
        *, block: str = "", entry: str = "", robot: str = "", host: str = "", here: str = ""
    ) -> PipelineResult:
        path = tmp_path / "robot.pbtxt"
        values = {"block": block, "entry": entry, "robot": robot, "host": host and f'host: "{host}"'}
        path.write_text(FILE % values)
        return examine(Request(str(path), host=here))

    yield examined
    for name in [name for name in sys.modules if name == "toy_policy.plugin"]:
        del sys.modules[name]


def policy(result: PipelineResult) -> Any:
    assert result.plan is not None, result.diagnostics
    return next(node for node in result.plan.nodes if node.name == "policy")


def test_the_state_comes_from_the_actuator_that_the_model_commands(robot: Any) -> None:
    node = policy(robot())
    assert [topic.name for topic in node.subscriptions] == ["/camera/top/image_raw", "/arm/joint_states"]
    facts = node.facts_as(ModelFacts)
    assert [feature.key for feature in facts.features] == ["observation.images.top", "observation.state"]
    assert facts.features[1].names == ("joint_1", "joint_2")


def test_what_the_entry_says_reaches_settings_and_facts(robot: Any) -> None:
    node = policy(
        robot(
            entry='task: "wave" execution { strategy: TEMPORAL_ENSEMBLE ramp_s: 0.1 } '
            'compute { device: "cpu" seed: 3 } rename { robot: "top" model: "camera1" }',
            block='camera: "camera1"',
        )
    )
    facts = node.facts_as(ModelFacts)
    assert (facts.task, facts.execution.strategy, facts.execution.ramp_s) == (
        "wave",
        "TEMPORAL_ENSEMBLE",
        0.1,
    )
    assert facts.features[0].key == "observation.images.camera1"
    assert (node.settings["task"], node.settings["rate_hz"]) == ("wave", 30.0)
    assert (node.settings["compute"]["seed"], node.settings["compute"]["device"]) == (3, "cpu")


def finding(result: PipelineResult, code: str) -> Any:
    (item,) = [item for item in result.diagnostics if item.code == code]
    return item


def test_a_camera_that_is_not_there_is_an_error_with_both_names(robot: Any) -> None:
    item = finding(robot(block='camera: "camera1"'), "model-unfit")
    assert item.message == (
        "The model needs observation.images.camera1 (toy); the robot provides observation.images.top."
    )
    assert item.remedy == 'Add rename { robot: "top" model: "camera1" } to the model.'
    assert item.allowed == ("top",)


def test_a_strategy_that_the_model_cannot_do_is_an_error_at_its_field(robot: Any) -> None:
    item = finding(robot(entry="execution { strategy: REAL_TIME_CHUNKING }"), "model-unfit")
    assert item.field_path == "ai.models[0].execution.strategy"
    assert item.allowed[0] == "REPLACE_ON_ARRIVAL"


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        (
            'rename { robot: "topp" model: "x" }',
            "topp is none of what the model gets: observation.images.top, observation.state.",
        ),
        ('rename { robot: "top" model: "observation.state" }', "Two features are called observation.state"),
    ],
)
def test_a_rename_of_nothing_and_onto_another_are_errors(robot: Any, entry: str, message: str) -> None:
    assert message.lower() in finding(robot(entry=entry), "rename-unfit").message.lower()


def test_a_model_that_reads_a_task_and_has_none_says_how_to_give_one(robot: Any) -> None:
    item = finding(robot(block="reads_task: true"), "task-missing")
    assert item.message == "policy has no task; the arm holds until it gets one."
    assert "joshua task" in item.remedy
    assert policy(robot(block="reads_task: true")).facts.reads_task


def test_weights_that_cannot_be_used_are_an_error_of_their_field(robot: Any) -> None:
    item = finding(robot(block='fault: "refused"'), "invalid-setting")
    assert (item.message, item.remedy) == ("The checkpoint is a pickle.", "Convert it.")
    assert item.field_path.endswith(".fault")


def test_an_arm_that_a_person_can_take_over_says_so_to_the_model(robot: Any) -> None:
    result = robot(robot=LEADER)
    assert policy(result).facts.interventions == ("/arm/intervention",)
    arm = next(node for node in result.plan.nodes if node.name == "arm")
    assert arm.facts.intervention
    assert policy(robot()).facts.interventions == ()


def test_pictures_travel_as_jpeg_to_a_model_on_another_machine(robot: Any) -> None:
    there = policy(robot(host="desk", here="desk"))
    topics = [(topic.name, topic.type_name.rpartition("/")[2]) for topic in there.subscriptions]
    assert topics == [
        ("/camera/top/image_raw/compressed", "CompressedImage"),
        ("/arm/joint_states", "JointState"),
    ]
    assert there.facts.features[0].topic == "/camera/top/image_raw/compressed"
    assert there.facts.features[0].key == "observation.images.top"
    result = robot(host="desk")
    camera = next(node for node in result.plan.nodes if node.name == "camera_top")
    assert [topic.name for topic in camera.publishers] == [
        "/camera/top/image_raw",
        "/camera/top/image_raw/compressed",
    ]
    assert camera.publishers[1].rate_hz == 10
    said = finding(result, "pictures-compressed").message
    assert said == "policy runs on another machine than camera_top: pictures travel as JPEG."
    assert policy(robot()).subscriptions[0].name == "/camera/top/image_raw"


def test_fields_of_another_strategy_are_noted(robot: Any) -> None:
    result = robot(entry="execution { ensemble_coefficient: 0.1 guidance_schedule: GUIDANCE_ONES }")
    notes = [item for item in result.diagnostics if item.code == "field-unused"]
    assert [(item.field_path.rpartition(".")[2], item.remedy) for item in notes] == [
        ("ensemble_coefficient", "Remove it, or set strategy: TEMPORAL_ENSEMBLE."),
        ("guidance_schedule", "Remove it, or set strategy: REAL_TIME_CHUNKING."),
    ]


SECOND = """
  actions { node { node_name: "arm_right" node_id: 4
      publishers { data_type: JOINT_STATE topic_name: "/right/joint_states" publish_rate_hz: 50 }
      subscriptions { data_type: JOINT_STATE topic_name: "%s" } }
    action_type: ACTION_MOCK mock_motor_config { num_motors: 2 position_max: 4095 } }"""
OUT = 'publishers { data_type: JOINT_STATE topic_name: "/ai/right" publish_rate_hz: 30 }'


def test_a_model_of_two_arms_names_their_joints_apart(robot: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    two = FILE.replace('"arm"', '"arm_left"').replace(
        "    subscriptions { data_type: IMAGE", f"{OUT}\n    subscriptions {{ data_type: IMAGE"
    )
    monkeypatch.setattr(sys.modules[__name__], "FILE", two)
    names = "right_joint_1 right_joint_2 left_joint_1 left_joint_2"
    node = policy(robot(robot=SECOND % "/ai/right", block=f'joints: "{names}"'))
    facts = node.facts_as(ModelFacts)
    assert [joint.name for joint in facts.joints] == names.split()
    (state,) = [feature for feature in facts.features if feature.key == "observation.state"]
    assert (state.names, state.topic) == (tuple(names.split()), "")
    assert {"/arm/joint_states", "/right/joint_states"} <= {topic.name for topic in node.subscriptions}
    assert facts.arms == (
        ModelArm("/ai/actions", "/arm/joint_states", ("joint_1", "joint_2"), "left_"),
        ModelArm("/ai/right", "/right/joint_states", ("joint_1", "joint_2"), "right_"),
    )
    unnamed = finding(robot(robot=SECOND % "/ai/right"), "model-unfit")
    assert "without names of its joints (toy), so it is unclear" in unnamed.message
    wrong = robot(robot=SECOND % "/ai/right", block='joints: "l_1 l_2 r_1 r_2"').diagnostics
    assert any("l_1, l_2, r_1, r_2 in the model (toy), left_joint_1" in item.message for item in wrong)


def test_two_arms_with_the_same_joints_need_a_topic_each(robot: Any) -> None:
    names = "arm_joint_1 arm_joint_2 right_joint_1 right_joint_2"
    item = finding(robot(robot=SECOND % "/ai/actions", block=f'joints: "{names}"'), "model-unfit")
    assert item.message == "policy commands arm and right by one topic, and their joints have the same names."
    assert item.remedy.startswith("Give the model one publisher for each arm")


@pytest.mark.parametrize(
    ("names", "prefixes"),
    [
        (("left_arm", "right_arm"), ["left_", "right_"]),
        (("follower_left", "follower_right"), ["left_", "right_"]),
        (("arm", "arm_2"), ["arm_", "2_"]),
        (("l_a", "a_l", "r_a"), ["l_a_", "a_l_", "r_a_"]),  # not l, l and r
    ],
)
def test_arms_are_told_apart_by_what_differs_in_their_names(
    robot: Any, monkeypatch: pytest.MonkeyPatch, names: tuple[str, ...], prefixes: list[str]
) -> None:
    first, *others = names
    outs = "\n".join(OUT.replace("right", name) for name in others)
    model = "    subscriptions { data_type: IMAGE"
    two = FILE.replace('"arm"', f'"{first}"').replace(model, f"{outs}\n{model}")
    monkeypatch.setattr(sys.modules[__name__], "FILE", two)
    actions = ""
    for number, name in enumerate(others, 4):
        one = (
            SECOND.replace("arm_right", name)
            .replace("right", name)
            .replace("node_id: 4", f"node_id: {number}")
        )
        actions += one % f"/ai/{name}"
    joints = " ".join(f"{prefix}joint_{number}" for prefix in prefixes for number in (1, 2))
    facts = policy(robot(robot=actions, block=f'joints: "{joints}"')).facts_as(ModelFacts)
    assert [arm.prefix for arm in facts.arms] == prefixes

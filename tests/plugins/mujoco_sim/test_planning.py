"""What a file with a simulation is checked for, and what its plan says."""

from __future__ import annotations

from pathlib import Path

import pytest
from joshua.plan import Severity
from joshua.planner.pipeline import PipelineResult, examine
from joshua.planner.request import Purpose, Request
from sim_configs import simulation_file


def examination(folder: Path, text: str, purpose: Purpose = Purpose.LAUNCH) -> PipelineResult:
    path = folder / "robot.pbtxt"
    path.write_text(text)
    return examine(Request(str(path), purpose=purpose))


def error(folder: Path, text: str, purpose: Purpose = Purpose.VALIDATE):
    errors = examination(folder, text, purpose).errors
    assert len(errors) == 1, errors
    return errors[0]


def test_simulated_devices_share_the_process_of_the_simulation(tmp_path) -> None:
    plan = examination(tmp_path, simulation_file()).plan
    groups = {node.name: node.process_group for node in plan.nodes}
    assert groups == {"arm": "simulation", "camera": "simulation", "simulation": "simulation"}
    arm = next(node for node in plan.nodes if node.name == "arm")
    assert arm.facts.simulation is not None
    assert arm.facts.simulation["model_path"] == "so_arm100/scene.xml"
    assert [joint.name for joint in arm.facts.joints][:2] == ["shoulder_pan", "shoulder_lift"]
    assert arm.facts.joints[5].max_rad == pytest.approx(2.0)


def test_shadows_and_the_unit_of_a_recording_come_from_the_file(tmp_path) -> None:
    def simulation(text: str):
        arm = next(node for node in examination(tmp_path, text).plan.nodes if node.name == "arm")
        return arm.facts.simulation

    plain = simulation(simulation_file())
    assert (plain["shadows"], plain["trajectory_unit"]) == (True, "")
    chosen = simulation(
        simulation_file(simulation="shadows: false trajectory_unit: TRAJECTORY_UNIT_LEROBOT_DEGREES")
    )
    assert (chosen["shadows"], chosen["trajectory_unit"]) == (False, "lerobot_deg")


def test_without_names_all_actuators_are_taken(tmp_path) -> None:
    plan = examination(tmp_path, simulation_file(arm="")).plan
    arm = next(node for node in plan.nodes if node.name == "arm")
    assert len(arm.facts.joints) == 6


def test_unknown_actuator_is_found_with_the_nearest_name(tmp_path) -> None:
    found = error(tmp_path, simulation_file(arm='actuators: ["shoulder_pan", "elbow_flx"]'))
    assert found.code == "invalid-setting"
    assert found.field_path == "robot.actions[0].sim_config.actuators[1]"
    assert found.position.line == 15
    assert "no actuator or joint named 'elbow_flx'" in found.message
    assert found.allowed[0] == "elbow_flex"
    assert found.remedy == "Did you mean elbow_flex?"


FOREIGN = """
<mujoco><compiler angle="radian"/><worldbody>
  <camera name="top" pos="0 0 3"/>
  <body pos="0 0 1"><joint name="elbow" range="-2 1"/><geom size=".05" pos=".2 0 0"/><site name="nozzle"/>
    <body><joint name="left" type="slide" axis="1 0 0" range="0 .04"/><geom size=".01"/></body>
    <body><joint name="right" type="slide" axis="-1 0 0" range="0 .04"/><geom size=".01"/></body>
  </body>
</worldbody>
<tendon><fixed name="split"><joint joint="left" coef=".5"/><joint joint="right" coef=".5"/></fixed></tendon>
<equality><joint joint1="left" joint2="right"/></equality>
<actuator>
  <motor joint="elbow" gear="20" ctrlrange="-1 1"/>
  <general name="fingers" tendon="split" ctrlrange="0 255" gainprm=".0157" biastype="affine"
    biasprm="0 -100 -10"/>
  <motor name="thruster" site="nozzle"/>
</actuator></mujoco>
"""


def foreign_file(folder: Path, arm: str) -> str:
    (folder / "foreign.xml").write_text(FOREIGN)
    return simulation_file(arm=arm).replace("so_arm100/scene.xml", "foreign.xml")


@pytest.mark.parametrize(
    "arm",
    ["", 'actuators: ["elbow", "left"]', 'actuators: ["elbow", "fingers"]', 'actuators: ["elbow", "split"]'],
)
def test_joints_of_a_foreign_model_are_known_by_every_name(tmp_path, arm: str) -> None:
    plan = examination(tmp_path, foreign_file(tmp_path, arm)).plan
    joints = next(node for node in plan.nodes if node.name == "arm").facts.joints
    assert [(joint.name, joint.min_rad, joint.max_rad) for joint in joints] == [
        ("elbow", -2, 1),
        ("left", 0, pytest.approx(0.04)),
    ]


def test_only_the_actuator_that_is_named_is_refused_with_the_reason(tmp_path) -> None:
    found = error(tmp_path, foreign_file(tmp_path, 'actuators: ["elbow", "thruster"]'))
    assert found.field_path == "robot.actions[0].sim_config.actuators[1]"
    assert (
        "actuator thruster pushes at a site and moves no joint of its own, so it cannot be" in found.message
    )
    assert found.allowed == ("elbow", "left")


def test_two_names_of_one_joint_are_refused(tmp_path) -> None:
    found = error(tmp_path, foreign_file(tmp_path, 'actuators: ["left", "split"]'))
    assert found.field_path == "robot.actions[0].sim_config.actuators[1]"
    assert "'split' is the same joint as 'left'" in found.message


def test_two_nodes_of_one_joint_are_refused(tmp_path) -> None:
    second = """
  actions {
    node {
      node_name: "second" node_id: 9
      publishers { data_type: JOINT_STATE topic_name: "/second/joint_states" publish_rate_hz: 50 }
    }
    action_type: ACTION_SINGLE
    sim_config { actuators: "split" }
  }
  perceptions {"""
    text = foreign_file(tmp_path, 'actuators: ["left"]').replace("\n  perceptions {", second)
    found = error(tmp_path, text)
    assert found.field_path == "robot.actions[1].sim_config.actuators[0]"
    assert found.message == "second drives 'left', which arm drives already."
    assert [related.label for related in found.related] == ["arm drives it here"]
    assert found.remedy == "Name each in one node only."


def test_an_unknown_name_is_answered_with_names_only(tmp_path) -> None:
    found = error(tmp_path, foreign_file(tmp_path, 'actuators: ["elbo"]'))
    assert found.remedy == "Did you mean elbow?"
    assert "" not in found.allowed


def test_gains_are_for_joints_that_a_loop_drives(tmp_path) -> None:
    def drive(joint: str) -> str:
        return f'drives {{ joint: "{joint}" position_gain: 30 velocity_gain: 2 }}'

    assert examination(tmp_path, foreign_file(tmp_path, drive("elbow")), Purpose.VALIDATE).errors == []
    found = error(tmp_path, foreign_file(tmp_path, drive("fingers")))
    assert found.field_path == "robot.actions[0].sim_config.drives[0].joint"
    assert "'fingers' follows positions by gains of its own, so these have no effect" in found.message
    found = error(tmp_path, foreign_file(tmp_path, f'actuators: ["left"] {drive("elbow")}'))
    assert "no joint in this node's actuators named 'elbow'" in found.message
    found = error(tmp_path, foreign_file(tmp_path, drive("elbow") * 2))
    assert "'elbow' has gains already" in found.message


def test_a_model_without_a_joint_to_drive_says_why(tmp_path) -> None:
    text = foreign_file(tmp_path, "")
    xml = FOREIGN.replace('<motor joint="elbow" gear="20" ctrlrange="-1 1"/>', "")
    xml = xml[: xml.index("<general")] + '<motor name="thruster" site="nozzle"/></actuator></mujoco>'
    (tmp_path / "foreign.xml").write_text(xml)
    found = error(tmp_path, text)
    assert found.field_path == "robot.actions[0].sim_config.actuators"
    assert "no joint that can be driven to a position: thruster pushes at a site" in found.message


def test_unknown_actuator_of_a_mapping_is_found(tmp_path) -> None:
    mapping = 'mirror_topic_mappings { ros_topic: "/arm/joint_states" mujoco_actuator: "griper" }'
    found = error(tmp_path, simulation_file(mode="MIRROR", simulation=mapping))
    assert found.field_path == "simulation.mirror_topic_mappings[0].mujoco_actuator"
    assert found.allowed[0] == "gripper"


def test_a_model_that_is_not_there_is_noted_with_the_nearest_and_stops_a_launch(tmp_path) -> None:
    text = simulation_file().replace("so_arm100/scene.xml", "so_arm100/scne.xml")
    for purpose, severity in ((Purpose.VALIDATE, Severity.NOTE), (Purpose.LAUNCH, Severity.ERROR)):
        found = [
            item
            for item in examination(tmp_path, text, purpose).diagnostics
            if item.field_path == "simulation.model_path"
        ]
        assert [item.severity for item in found] == [severity]
        assert "nearest: so_arm100/scene.xml" in found[0].message
    assert examination(tmp_path, text, Purpose.LAUNCH).plan is None


def test_unknown_camera_is_found(tmp_path) -> None:
    found = error(tmp_path, simulation_file(camera="tap"))
    assert found.field_path == "robot.perceptions[0].sim_camera_config.camera"
    assert found.allowed == ("top", "front", "wrist", "overview")


def test_unknown_keyframe_is_found(tmp_path) -> None:
    found = error(tmp_path, simulation_file(simulation='keyframe: "hom"'))
    assert found.field_path == "simulation.keyframe"
    assert found.allowed[0] == "home"


def test_malformed_model_is_found_with_its_line(tmp_path) -> None:
    (tmp_path / "bad.xml").write_text("<mujoco>\n<worldbody>\n<gem/>\n</worldbody></mujoco>")
    text = simulation_file().replace("so_arm100/scene.xml", "bad.xml")
    errors = examination(tmp_path, text, Purpose.VALIDATE).errors
    assert errors[0].field_path == "simulation.model_path"
    assert "line 3" in errors[0].message
    assert "gem" in errors[0].message


def test_missing_model_is_an_error_at_launch(tmp_path) -> None:
    text = simulation_file().replace("so_arm100/scene.xml", "mine.xml")
    errors = examination(tmp_path, text).errors
    assert "input-file-missing" in [item.code for item in errors]


def test_own_model_is_found_beside_the_file(tmp_path) -> None:
    (tmp_path / "mine.xml").write_text(
        "<mujoco><worldbody><camera name='top'/><body><geom size='1'/><joint name='hinge'/></body>"
        "</worldbody><actuator><position name='drive' joint='hinge'/></actuator></mujoco>"
    )
    text = simulation_file(arm='actuators: "drive"').replace("so_arm100/scene.xml", "mine.xml")
    assert [i for i in examination(tmp_path, text).diagnostics if i.severity is Severity.ERROR] == []


def passive_file(recording: str) -> str:
    return f"""
general {{ mode: MODE_SIMULATION name: "p" id: "passive-test" }}
simulation {{ mode: PASSIVE model_path: "so_arm100/scene.xml" trajectory_path: "{recording}" }}
"""


@pytest.mark.parametrize(
    ("name", "content", "text"),
    [
        (
            "wave.csv",
            "time_s,shoulder_pan\n0,0\n0.1\n",
            "line 3: 1 columns, and line 1 names 2 (time_s, shoulder_pan)",
        ),
        (
            "wave.csv",
            "time_s,shoulder_pna\n0,0\n",
            "no column fits a joint of the model: it has shoulder_p",
        ),
        ("wave.csv", "time_s,shoulder_pan\n0,nan\n", "sample 1 holds a value that is not a finite number"),
        ("wave.jsonl", '{"time_s": 0, "action": [1, 2]}\n', "2 columns without names, and the model has 6"),
        ("wave.txt", "", ".txt is not a supported format"),
    ],
)
def test_bad_recording_is_found_before_the_start(tmp_path, name: str, content: str, text: str) -> None:
    (tmp_path / name).write_text(content)
    found = error(tmp_path, passive_file(name))
    assert found.field_path == "simulation.trajectory_path"
    assert found.position.line == 3
    assert text in found.message


def test_missing_recording_is_an_error_at_launch(tmp_path) -> None:
    assert not examination(tmp_path, passive_file("no.csv"), Purpose.VALIDATE).errors
    (found,) = examination(tmp_path, passive_file("no.csv")).errors
    assert (found.code, found.field_path) == ("input-file-missing", "simulation.trajectory_path")
    assert "The recording does not exist: looked for" in found.message


def test_recording_that_nothing_replays_is_an_error(tmp_path) -> None:
    found = error(tmp_path, simulation_file(simulation='trajectory_path: "wave.csv"'))
    assert found.field_path == "simulation.trajectory_path"
    assert "has no effect with mode: OFFSCREEN" in found.message


@pytest.mark.parametrize(
    ("text", "field"),
    [
        (simulation_file(), "robot.perceptions[0].sim_camera_config.camera"),
        (
            simulation_file(
                simulation='renders { camera: "top" width: 64 height: 48 fps: 5 output: "a_%03d.png" }'
            ).partition("perceptions")[0]
            + "}",
            "simulation.renders[0].camera",
        ),
    ],
)
def test_launch_without_opengl_is_refused_before_it_starts(
    tmp_path, monkeypatch: pytest.MonkeyPatch, text: str, field: str
) -> None:
    monkeypatch.setenv("MUJOCO_GL", "disabled")
    assert not examination(tmp_path, text, Purpose.VALIDATE).errors  # it may run elsewhere
    (found,) = examination(tmp_path, text).errors
    assert found.field_path == field
    assert "MUJOCO_GL=disabled disables rendering" in found.message

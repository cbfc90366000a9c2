"""A checkpoint against a robot, before anything starts and without torch: what differs, and what to do."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import pytest
from checkpoints import write_checkpoint, write_dataset, write_robot, write_tensors
from joshua.cli.report import exit_code_of
from joshua.plan import Severity
from joshua.planner.pipeline import examine
from joshua.planner.request import Purpose, Request
from joshua.tools import ExitCode, check, plan, render_text
from joshua_lerobot.settings import environment


def findings(path: Path) -> list[tuple[str, str, str]]:
    """Message, field and remedy of each error."""
    return [(item.message, item.field_path, item.remedy) for item in check(path).errors]


@pytest.fixture
def weights(tmp_path: Path) -> Path:
    return write_checkpoint(tmp_path / "act")


def test_a_checkpoint_that_fits_is_planned_with_the_state_of_the_arm(tmp_path: Path, weights: Path):
    result = plan(write_robot(tmp_path / "robot.pbtxt", "act"))
    assert result.errors == []
    assert result.plan is not None
    (node,) = (node for node in result.plan.nodes if node.name == "policy")
    assert node.settings["weights"] == str(weights)
    assert [topic.name for topic in node.subscriptions] == ["/camera/top/image_raw", "/arm/joint_states"]
    assert not {"torch", "lerobot", "numpy"} & set(sys.modules) - {"numpy"}


def test_another_camera_is_named_with_the_rename_that_mends_it(tmp_path: Path, weights: Path):
    robot = write_robot(tmp_path / "robot.pbtxt", "act", cameras={"front": (64, 48)})
    ((message, _, remedy),) = findings(robot)
    assert message == (
        f"The model needs observation.images.top ({weights}/config.json); the robot provides "
        "observation.images.front."
    )
    assert 'rename { robot: "front" model: "top" }' in remedy
    renamed = write_robot(
        tmp_path / "robot.pbtxt",
        "act",
        cameras={"front": (64, 48)},
        extra='rename { robot: "front" model: "top" }',
    )
    assert findings(renamed) == []


def test_pictures_of_another_size_are_an_error_where_the_policy_does_not_scale_them(
    tmp_path: Path, weights: Path
):
    robot = write_robot(tmp_path / "robot.pbtxt", "act", cameras={"top": (128, 96)})
    ((message, _, remedy),) = findings(robot)
    assert "needs 64 × 48 pixels" in message
    assert "has 128 × 96" in message
    assert remedy == "Set width: 64 height: 48 in the camera's block."
    write_checkpoint(weights, kind="smolvla", resize_imgs_with_padding=[512, 512])
    assert findings(robot) == []


def test_another_number_of_joints_is_an_error_on_both_sides(tmp_path: Path):
    write_checkpoint(tmp_path / "act", joints=7)
    found = findings(write_robot(tmp_path / "robot.pbtxt", "act"))
    assert [message.partition(" (")[0] for message, _, _ in found] == [
        "observation.state: the model has 7 numbers",
        "action: the model has 7 numbers",
    ]


def test_joints_and_rate_of_the_data_set_are_compared(tmp_path: Path, weights: Path):
    write_dataset(weights, names=[f"motor_{i + 1}" for i in range(6)])
    found = findings(write_robot(tmp_path / "robot.pbtxt", "act", rate_hz=10.0))
    assert len(found) == 3
    assert "the names differ: motor_1, motor_2" in found[0][0]
    assert "acts 30 times a second" in found[2][0]
    assert found[2][2] == "Set publish_rate_hz: 30."
    write_dataset(weights, names=[f"joint_{i + 1}" for i in range(6)])
    assert findings(write_robot(tmp_path / "robot.pbtxt", "act")) == []


def test_joints_in_another_order_are_given_to_the_policy_in_its_own(tmp_path: Path, weights: Path):
    write_dataset(weights, names=[f"joint_{i}" for i in (2, 1, 3, 4, 5, 6)])
    planned = plan(write_robot(tmp_path / "robot.pbtxt", "act"))
    assert planned.errors == []
    assert planned.plan is not None
    (facts,) = (node.facts for node in planned.plan.nodes if node.name == "policy")
    order = ["joint_2", "joint_1", "joint_3", "joint_4", "joint_5", "joint_6"]
    assert [joint.name for joint in facts.joints] == order
    assert list(facts.features[-1].names) == order
    assert facts.features[-1].key == "observation.state"


def test_without_pytorch_a_launch_is_refused_and_a_check_notes_it(
    tmp_path: Path, weights: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "torch" else object())
    robot = write_robot(tmp_path / "robot.pbtxt", "act")
    for purpose, severity in ((Purpose.VALIDATE, Severity.NOTE), (Purpose.LAUNCH, Severity.ERROR)):
        result = examine(Request(str(robot), purpose=purpose))
        (finding,) = (item for item in result.diagnostics if item.code == "extra-missing")
        assert finding.severity is severity
        assert finding.message == f"policy requires torch, which {sys.executable} does not have."
        assert finding.remedy.startswith("Make an environment that has it: ")
        assert 'python: "policies/bin/python"' in finding.remedy
    assert exit_code_of(result) == ExitCode.NOT_INSTALLED
    text = robot.read_text().replace('node_name: "policy"', f'node_name: "policy" python: "{sys.executable}"')
    robot.write_text(text)
    others = examine(Request(str(robot), purpose=Purpose.LAUNCH)).diagnostics
    assert "extra-missing" not in [item.code for item in others], "that interpreter is asked at its start"


def test_policies_that_need_more_than_pytorch_say_how_to_add_it(
    tmp_path: Path, weights: Path, monkeypatch: pytest.MonkeyPatch
):
    missing = {"transformers", "tree", "timm"}
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name in missing else object())
    write_checkpoint(weights, kind="groot")
    result = examine(Request(str(write_robot(tmp_path / "robot.pbtxt", "act")), purpose=Purpose.LAUNCH))
    (finding,) = (item for item in result.diagnostics if item.code == "extra-missing")
    assert "policy requires transformers, tree, timm, which " in finding.message
    assert finding.remedy.endswith("python -m pip install 'lerobot[groot]'.")
    for kind in ("pi0", "pi05"):
        write_checkpoint(weights, kind=kind)
        result = examine(Request(str(tmp_path / "robot.pbtxt"), purpose=Purpose.LAUNCH))
        (finding,) = (item for item in result.diagnostics if item.code == "extra-missing")
        assert finding.remedy.endswith("python -m pip install 'lerobot[pi]'.")


def test_the_unit_of_the_data_set_and_that_of_the_file_must_agree(tmp_path: Path, weights: Path):
    write_dataset(weights, names=[f"joint_{i + 1}" for i in range(6)])
    block = "plugin_config { [joshua/joshua.LeRobotPolicy] { units: UNIT_DEGREES } }"
    ((message, field, remedy),) = findings(write_robot(tmp_path / "robot.pbtxt", "act", block=block))
    assert message == f"{weights} was trained on joints in UNIT_LEROBOT, and the file says UNIT_DEGREES."
    assert field.endswith(".units")
    assert remedy.startswith("Remove units")


def test_statistics_that_no_joint_in_radians_has_refuse_radians(tmp_path: Path, weights: Path):
    block = "plugin_config { [joshua/joshua.LeRobotPolicy] { units: UNIT_RADIANS } }"
    ((message, _, remedy),) = findings(write_robot(tmp_path / "robot.pbtxt", "act", block=block))
    assert "reach 95, more than a turn (6.283 rad)" in message
    assert "UNIT_LEROBOT" in remedy
    write_checkpoint(weights, least=-1.5, greatest=1.4)
    assert findings(write_robot(tmp_path / "robot.pbtxt", "act", block=block)) == []


def test_statistics_of_another_robot_are_found(tmp_path: Path, weights: Path):
    config = json.loads((weights / "config.json").read_text())
    write_checkpoint(weights, joints=7)
    (weights / "config.json").write_text(json.dumps(config))
    ((message, _, _),) = findings(write_robot(tmp_path / "robot.pbtxt", "act"))
    assert "observation.state has 6 numbers, and its statistics 'mean' 7: they are those of" in message


@pytest.mark.parametrize(
    ("block", "said"),
    [
        ("absent_cameras: 'side'", "observation.images.side is not a camera of"),
        ("absent_cameras: 'top'", "A policy of type 'act' requires every camera"),
        ("denoising_steps: 5", "A policy of type 'act' does not denoise"),
        ("picture_size: 256", "A policy of type 'act' takes pictures of one size only"),
        ("actions_per_chunk: 21", "has 20 actions"),
        ("revision: 'main'", "revision has an effect only on a checkpoint of the hub"),
    ],
)
def test_choices_that_do_not_fit_the_policy_are_refused(tmp_path: Path, weights: Path, block: str, said: str):
    block = f"plugin_config {{ [joshua/joshua.LeRobotPolicy] {{ {block} }} }}"
    ((message, field, remedy),) = findings(write_robot(tmp_path / "robot.pbtxt", "act", block=block))
    assert said in message
    assert field.startswith("ai.models[0].plugin_config")
    assert remedy


def test_a_pickle_is_refused_with_the_way_to_convert_it(tmp_path: Path, weights: Path):
    (weights / "model.safetensors").rename(weights / "pytorch_model.bin")
    ((message, _, remedy),) = findings(write_robot(tmp_path / "robot.pbtxt", "act"))
    assert "pytorch_model.bin, a pickle, which executes what it contains when it is loaded" in message
    assert "policy.save_pretrained(FOLDER)" in remedy


def test_an_adapter_is_refused_with_the_way_to_merge_it(tmp_path: Path, weights: Path):
    config = json.loads((weights / "config.json").read_text())
    (weights / "config.json").write_text(json.dumps(config | {"use_peft": True}))
    ((message, _, remedy),) = findings(write_robot(tmp_path / "robot.pbtxt", "act"))
    assert message == f"{weights} is an adapter (PEFT), not a complete policy."
    (weights / "model.safetensors").rename(weights / "adapter_model.safetensors")
    (weights / "adapter_config.json").write_text(json.dumps({"base_model_name_or_path": "acme/base"}))
    for changed in (config | {"use_peft": True}, config):  # or an adapter alone
        (weights / "config.json").write_text(json.dumps(changed))
        ((message, _, remedy),) = findings(tmp_path / "robot.pbtxt")
        assert message == f"{weights} is an adapter (PEFT), not a complete policy."
        assert f"PeftModel.from_pretrained(BASE, '{weights}').merge_and_unload()" in remedy
        assert "that LeRobot loads from acme/base; set policy.config.use_peft = False" in remedy


def test_a_torn_file_is_found_by_its_length(tmp_path: Path, weights: Path):
    path = weights / "model.safetensors"
    path.write_bytes(path.read_bytes()[:-1])
    ((message, _, remedy),) = findings(write_robot(tmp_path / "robot.pbtxt", "act"))
    assert "the file was not copied or downloaded to its end" in message
    assert remedy == "Copy or download the checkpoint again."
    path.write_bytes(b"\x00" * 4)
    assert "its header is missing or cut off" in findings(tmp_path / "robot.pbtxt")[0][0]
    path.write_bytes((20).to_bytes(8, "little") + b"{" * 20)
    assert "its header cannot be read" in findings(tmp_path / "robot.pbtxt")[0][0]


@pytest.mark.parametrize(
    "name", ["model.safetensors", "policy_preprocessor_step_0_normalizer_processor.safetensors"]
)
def test_a_pointer_in_place_of_weights_names_the_command_that_fetches_them(
    tmp_path: Path, weights: Path, name: str
):
    (weights / name).write_text(f"version https://git-lfs.github.com/spec/v1\noid sha256:{0:064}\nsize 9\n")
    (tmp_path / ".git").mkdir()
    ((message, _, remedy),) = findings(write_robot(tmp_path / "robot.pbtxt", "act"))
    assert (
        message
        == f"{weights / name} is a Git LFS pointer: the repository was cloned without its large files."
    )
    assert remedy == f"Run git -C {tmp_path} lfs pull --include act/{name}."


def test_a_processor_with_code_of_its_own_is_refused(tmp_path: Path, weights: Path):
    step = {"class": "evil.module.Step", "config": {}}
    (weights / "policy_preprocessor.json").write_text(json.dumps({"steps": [step]}))
    ((message, _, _),) = findings(write_robot(tmp_path / "robot.pbtxt", "act"))
    assert "names evil.module.Step as a processor: loading it would execute code" in message
    step = {"registry_name": "normalizer_processor", "state_file": "../other.safetensors"}
    (weights / "policy_preprocessor.json").write_text(json.dumps({"steps": [step]}))
    assert "only a .safetensors file beside it is loaded" in findings(tmp_path / "robot.pbtxt")[0][0]


def test_a_checkpoint_without_processors_names_the_converter(tmp_path: Path, weights: Path):
    (weights / "policy_preprocessor.json").unlink()
    ((message, _, remedy),) = findings(write_robot(tmp_path / "robot.pbtxt", "act"))
    assert "written before LeRobot 0.4" in message
    assert f"migrate_policy_normalization --pretrained-path {weights}" in remedy


def test_a_folder_of_a_training_names_the_checkpoint_in_it(tmp_path: Path):
    inner = write_checkpoint(tmp_path / "run" / "checkpoints" / "last" / "pretrained_model")
    ((message, _, remedy),) = findings(write_robot(tmp_path / "robot.pbtxt", "run"))
    assert message == f"{tmp_path / 'run'} has no config.json."
    assert remedy == f"Name its folder {inner}."


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ('{"architectures": ["X"]}', "it describes a model of transformers"),
        ("{", "is not JSON"),
        ("[]", "is not a JSON object"),
        ('{"type": "act", "input_features": {"a": 1}}', "input_features is not a description of features"),
    ],
)
def test_a_config_that_describes_no_policy_is_refused(tmp_path: Path, weights: Path, content: str, said: str):
    (weights / "config.json").write_text(content)
    ((message, _, _),) = findings(write_robot(tmp_path / "robot.pbtxt", "act"))
    assert said in message


def test_a_missing_folder_is_found_and_a_file_is_none(tmp_path: Path):
    error, _ = check(write_robot(tmp_path / "robot.pbtxt", "./nothing/here")).diagnostics  # and no PyTorch
    assert error.severity is Severity.ERROR
    assert "The weights do not exist: looked for" in error.message
    assert error.field_path == "ai.models[0].pretrained_model_name_or_path"
    (tmp_path / "policy.bin").write_bytes(b"")
    ((message, _, _),) = findings(write_robot(tmp_path / "robot.pbtxt", "policy.bin"))
    assert "is a file, but a checkpoint is a folder" in message


def test_smolvla_refuses_another_policy_and_runs_without_a_block(tmp_path: Path, weights: Path):
    robot = write_robot(tmp_path / "robot.pbtxt", "act", model_type="SMOLVLA", block="")
    ((message, _, remedy),) = findings(robot)
    assert "holds a policy of type 'act', and this model_type runs 'smolvla'" in message
    assert "[joshua/joshua.LeRobotPolicy]" in remedy
    write_checkpoint(weights, kind="smolvla", resize_imgs_with_padding=[512, 512])
    result = check(robot)
    assert result.errors == []
    assert [item.code for item in result.diagnostics] == ["extra-missing", "task-missing"]


def test_a_size_of_pictures_that_the_model_cannot_cut_names_the_nearest(tmp_path: Path, weights: Path):
    write_checkpoint(weights, kind="smolvla", resize_imgs_with_padding=[512, 512])
    block = "smolvla_config { picture_size: 250 }"
    ((message, field, remedy),) = findings(
        write_robot(tmp_path / "robot.pbtxt", "act", model_type="SMOLVLA", block=block)
    )
    assert "into squares of 64 pixels, but 250 is not a multiple" in message
    assert field == "ai.models[0].smolvla_config.picture_size"
    assert remedy == "Write picture_size: 256."


def test_smolvla_leaves_out_a_camera_that_the_robot_does_not_have(tmp_path: Path, weights: Path):
    write_checkpoint(weights, kind="smolvla", cameras={"top": (64, 48), "wrist": (64, 48)}, num_steps=10)
    robot = tmp_path / "robot.pbtxt"
    block = 'smolvla_config {{ absent_cameras: "{}" }}'
    write_robot(robot, "act", model_type="SMOLVLA", block="")
    assert "needs observation.images.wrist" in findings(robot)[0][0]
    write_robot(robot, "act", model_type="SMOLVLA", block=block.format("wrist"))
    assert findings(robot) == []
    write_robot(robot, "act", model_type="SMOLVLA", block=block.format("side"))
    ((message, field, _),) = findings(robot)
    assert "observation.images.side is not a camera of" in message
    assert field == "ai.models[0].smolvla_config.absent_cameras"


def test_a_checkpoint_of_the_hub_is_read_where_it_was_downloaded_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("HF_HOME", str(tmp_path / "home"))
    place = tmp_path / "home" / "hub" / "models--acme--policy"
    robot = write_robot(tmp_path / "robot.pbtxt", "acme/policy", cameras={"front": (64, 48)})
    assert findings(robot) == []  # nothing is known before the node has fetched it
    write_checkpoint(place / "snapshots" / "0123")
    (place / "refs").mkdir()
    (place / "refs" / "main").write_text("0123")
    assert "needs observation.images.top" in findings(robot)[0][0]


def test_a_training_of_lerobot_tells_where_its_data_set_is(tmp_path: Path, weights: Path):
    names = [f"joint_{i + 1}.pos" for i in range(6)]
    action = {"dtype": "float32", "shape": [6], "names": names}
    place = tmp_path / "data" / "meta"
    place.mkdir(parents=True)
    (place / "info.json").write_text(json.dumps({"fps": 15, "features": {"action": action}}))
    (weights / "train_config.json").write_text(
        json.dumps({"dataset": {"repo_id": "a/b", "root": str(tmp_path / "data")}})
    )
    ((message, _, _),) = findings(write_robot(tmp_path / "robot.pbtxt", "act"))
    assert "acts 15 times a second" in message


def test_checking_a_checkpoint_imports_nothing_heavy(tmp_path: Path, weights: Path):
    robot = write_robot(tmp_path / "robot.pbtxt", "act")
    heavy = {"torch", "lerobot", "numpy", "huggingface_hub", "joshua_lerobot.policy"}
    program = (
        f"import sys; from joshua.tools import check; assert not check({str(robot)!r}).errors; "
        f"print(sorted({heavy!r} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_findings_of_a_file_read_well(tmp_path: Path, weights: Path):
    result = check(write_robot(tmp_path / "robot.pbtxt", "act", cameras={"front": (64, 48)}))
    text = render_text(result.diagnostics, dict(result.sources))
    assert "[model-unfit]" in text


def test_show_prints_what_a_checkpoint_needs(tmp_path: Path, weights: Path, capsys):
    from joshua.cli.main import main

    write_dataset(weights)
    assert main(["policy", "show", str(weights)]) == 0
    assert capsys.readouterr().out.splitlines() == [
        f"{weights}: act",
        "  sees  observation.state       6 lerobot  MEAN_STD  "
        "shoulder_pan, shoulder_lift, elbow_flex, wrist_flex, wrist_roll, gripper",
        "  sees  observation.images.top  64 x 48    IDENTITY",
        "  does  action                  6 lerobot  MEAN_STD  "
        "shoulder_pan, shoulder_lift, elbow_flex, wrist_flex, wrist_roll, gripper",
        "  chunk of 20 actions at 30 Hz",
    ]
    assert main(["policy", "show", str(tmp_path / "none")]) == 1
    assert capsys.readouterr().err == (
        f"joshua policy show: {tmp_path / 'none'} does not exist. Name the folder that holds config.json and "
        "model.safetensors\n"
    )


def test_show_names_what_has_no_statistics(weights: Path, capsys):
    from joshua.cli.main import main

    (state,) = weights.glob("policy_preprocessor_step*")
    write_tensors(state, {})
    (state,) = weights.glob("policy_postprocessor_step*")
    write_tensors(state, {})
    assert main(["policy", "show", str(weights)]) == 0
    out = capsys.readouterr().out
    assert "no statistics of observation.state, action, which it normalises: it does not run before" in out


def test_outside_of_a_clone_the_extra_needs_a_python_that_it_resolves_on(monkeypatch: pytest.MonkeyPatch):
    command = "pip install 'joshua-lerobot[policies]'"
    monkeypatch.setattr("joshua_lerobot.settings.install", lambda *_: command)
    assert environment().startswith(f"Make an environment of Python 3.12 that has it: {command} (PyTorch")

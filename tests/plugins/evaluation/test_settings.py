"""What a validation says of an evaluation; nothing heavy is imported for it."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from checkpoints import write_checkpoint, write_dataset
from evaluation_files import write_evaluation
from joshua.plan import Severity
from joshua.planner.pipeline import examine
from joshua.planner.request import Purpose, Request


def errors(folder: Path, checkpoint: Path | str, more: str = "", **options: Any) -> list[Any]:
    path = write_evaluation(folder, checkpoint, more, **options)
    return list(examine(Request(str(path), purpose=Purpose.VALIDATE)).errors)


def test_an_evaluation_is_valid_without_anything_heavy(tmp_path: Path, random_policy: Path) -> None:
    path = write_evaluation(tmp_path, random_policy, 'metrics: ["success_rate", "smoothness"]')
    code = f"""
import sys
from joshua.planner.pipeline import examine
from joshua.planner.request import Purpose, Request
assert not examine(Request({str(path)!r}, purpose=Purpose.VALIDATE)).errors
print(sorted({{"av", "torch", "gymnasium", "numpy", "mujoco", "safetensors"}} & set(sys.modules)))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_an_unknown_metric_is_answered_with_the_nearest(tmp_path: Path, random_policy: Path) -> None:
    (error,) = errors(tmp_path, random_policy, 'metrics: ["avg_return", "sucess_rate"]')
    assert error.field_path == "ai.training.eval_config.metrics[1]"
    assert error.message == "There is no metric 'sucess_rate'."
    assert error.allowed[0] == "success_rate"
    assert error.remedy == 'Write "success_rate", or install the plugin that adds it.'
    assert error.position.line == 11
    (error,) = errors(tmp_path, random_policy, 'metrics: ["avg_return", "avg_return"]')
    assert "is listed twice" in error.message


def test_a_checkpoint_of_another_environment_is_refused(tmp_path: Path, random_policy: Path) -> None:
    other = 'environment_id: "joshua/SoArm100PickPlace-v0"'
    (error,) = errors(tmp_path, random_policy, environment=other)
    assert error.field_path == "ai.training.eval_config.model_checkpoint"
    assert "was trained in joshua/SoArm100Reach-v0, not in joshua/SoArm100Pick" in error.message
    assert 'environment_id: "joshua/SoArm100Reach-v0"' in error.remedy
    assert error.position.line == 9


def test_the_environment_of_the_checkpoint_is_proposed(tmp_path: Path, random_policy: Path) -> None:
    (error,) = errors(tmp_path, random_policy, environment="")
    assert error.field_path == "ai.training.environment_id"
    assert "the checkpoint was trained in joshua/SoArm100Reach-v0" in error.message
    assert error.remedy == 'Add environment_id: "joshua/SoArm100Reach-v0".'


def test_no_episode_is_refused(tmp_path: Path, random_policy: Path) -> None:
    (error,) = errors(tmp_path, random_policy, episodes=0)
    assert error.field_path == "ai.training.eval_config.num_episodes"


@pytest.mark.parametrize("purpose", [Purpose.VALIDATE, Purpose.LAUNCH])
def test_a_missing_checkpoint_is_an_error_with_the_command_that_trains_one(
    tmp_path: Path, purpose: Purpose
) -> None:
    path = write_evaluation(tmp_path, "checkpoints/none", 'compare_with: "runs/none"')
    found = examine(Request(str(path), purpose=purpose)).errors
    assert [item.code for item in found] == ["weights-not-found", "weights-not-found"]
    assert [item.position.line for item in found] == [9, 11]
    assert "joshua new train --from training_rl_ppo" in found[0].remedy


def test_the_policy_that_ships_with_its_trainer_is_known_by_name(tmp_path: Path) -> None:
    assert errors(tmp_path, "joshua/so_arm100/reach") == []
    (found,) = errors(tmp_path, "joshua/so_arm100/reech")
    assert found.code == "weights-not-found"


def torn(folder: Path, policy: Path, change: str) -> Path:
    copy = folder / "copy"
    shutil.copytree(policy, copy)
    if change == "weights":
        (copy / "policy.safetensors").unlink()
    elif change == "json":
        (copy / "policy.json").write_text('{"algorithm": "PPO", "feat')
    elif change == "foreign":
        (copy / "policy.json").write_text('{"kind": "other"}')
    elif change == "nothing":
        (copy / "policy.json").unlink()
    return copy


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("weights", "is incomplete: it has no policy.safetensors"),
        ("json", "policy.json is truncated or not JSON"),
        ("foreign", "was not written by a trainer of JOSHUA"),
        ("nothing", "contains neither a run (run.json), nor a policy of a trainer (policy.json)"),
    ],
)
def test_files_that_are_torn_or_foreign_are_refused_at_their_line(
    tmp_path: Path, random_policy: Path, change: str, said: str
) -> None:
    (error,) = errors(tmp_path, torn(tmp_path, random_policy, change))
    assert said in error.message
    assert (error.field_path, error.position.line) == ("ai.training.eval_config.model_checkpoint", 9)
    assert error.remedy


def test_a_file_in_place_of_a_folder_is_answered_with_the_folder(tmp_path: Path, random_policy: Path) -> None:
    (error,) = errors(tmp_path, random_policy / "policy.json")
    assert "is a file, but a checkpoint is a folder" in error.message
    assert error.remedy == f"Write {random_policy}."


@pytest.mark.parametrize(
    ("more", "field", "beside_a_model"),
    [
        ('task: "reach the goal"', "task", False),
        ("strategy: TEMPORAL_ENSEMBLE", "strategy", False),
        ("steps_per_chunk: 4", "steps_per_chunk", False),
        ("compute { threads: 2 }", "compute", False),
        ("inference_delay: 5", "inference_delay", True),
    ],
)
def test_what_the_policy_of_a_trainer_cannot_do_is_named(
    tmp_path: Path, random_policy: Path, more: str, field: str, beside_a_model: bool
) -> None:
    """A model beside it uses them; a delay of the model alone would make the comparison unfair."""
    (error,) = errors(tmp_path, random_policy, more)
    assert error.field_path == f"ai.training.eval_config.{field}"
    assert error.message.startswith(f"{field} has no effect on {random_policy}, the policy of a trainer")
    assert error.remedy.startswith("Remove it")
    assert error.position.line == 11
    write_checkpoint(tmp_path / "act")
    write_dataset(tmp_path / "act")
    both = f'compare_with: "{random_policy}" {more}'
    assert [item.field_path for item in errors(tmp_path, "act", both)] == [error.field_path] * beside_a_model
    assert [item.code for item in errors(tmp_path, "missing", both)] == ["weights-not-found"]
    assert errors(tmp_path, "act", more) == []


def test_defaults_of_models_are_no_error_of_the_policy_of_a_trainer(
    tmp_path: Path, random_policy: Path
) -> None:
    usual = 'task: "" strategy: SYNCHRONOUS inference_delay: 0 compute { threads: 1 } randomise: true'
    assert errors(tmp_path, random_policy, usual) == []


def test_a_run_means_its_newest_checkpoint(tmp_path: Path, random_policy: Path) -> None:
    run = tmp_path / "runs" / "reach"
    (run / "checkpoints").mkdir(parents=True)
    (run / "run.json").write_text("{}")
    (error,) = errors(tmp_path, "runs/reach")
    assert "has no checkpoint" in error.message
    for number in (100, 200):
        shutil.copytree(random_policy, run / "checkpoints" / f"step_{number:012d}")
    path = write_evaluation(tmp_path, "runs/reach", 'compare_with: "runs/reach"')
    plan = examine(Request(str(path))).plan
    (node,) = plan.nodes
    assert [item["path"] for item in node.settings["candidates"]] == [
        str(run / "checkpoints" / "step_000000000200")
    ] * 2


def test_a_policy_of_lerobot_is_checked_by_its_plugin(tmp_path: Path) -> None:
    write_checkpoint(tmp_path / "act")
    write_dataset(tmp_path / "act")
    path = write_evaluation(tmp_path, "act")
    (node,) = examine(Request(str(path))).plan.nodes
    model = node.settings["candidates"][0]["model"]
    assert model["block"] == "joshua.LeRobotPolicy"
    assert model["settings"]["weights"] == str(tmp_path / "act")
    whole = (tmp_path / "act" / "model.safetensors").read_bytes()
    (tmp_path / "act" / "model.safetensors").write_bytes(whole[:-3])
    (error,) = errors(tmp_path, "act")
    assert "the file was not copied or downloaded to its end" in error.message
    config = json.loads((tmp_path / "act" / "config.json").read_text())
    (tmp_path / "act" / "config.json").write_text(json.dumps(config | {"onnx": {"bytes": 3}}))
    (error,) = errors(tmp_path, "act")
    assert "exported" in error.message


def test_a_run_of_imitation_means_the_policy_of_its_newest_checkpoint(tmp_path: Path) -> None:
    run = tmp_path / "act-20261122"
    for steps in (100, 200):
        write_checkpoint(run / "checkpoints" / f"step_{steps:012d}" / "pretrained_model")
    (run / "run.json").write_text("{}")
    newest = run / "checkpoints" / "step_000000000200"
    for named in (run, newest, newest / "pretrained_model"):
        (node,) = examine(Request(str(write_evaluation(tmp_path, named)))).plan.nodes
        assert node.settings["candidates"][0]["path"] == str(newest / "pretrained_model")


def test_the_block_of_a_model_plugin_is_typed_and_used(tmp_path: Path) -> None:
    write_checkpoint(tmp_path / "act")
    block = "plugin_config { [joshua/joshua.LeRobotPolicy] { actions_per_chunk: 5 } } compute { seed: 3 }"
    (node,) = examine(Request(str(write_evaluation(tmp_path, "act", block)))).plan.nodes
    settings = node.settings["candidates"][0]["model"]["settings"]
    assert settings["actions_per_chunk"] == 5
    assert settings["compute"]["seed"] == 3
    (error,) = errors(tmp_path, "act", block.replace("5", "500"))
    assert "A chunk of" in error.message
    assert error.field_path == "ai.training.eval_config.plugin_config.actions_per_chunk"
    assert error.position.line == 11
    (error,) = errors(tmp_path, "act", block.replace("actions_per", "action_per"))
    assert error.code == "unknown-field"


def test_a_model_whose_plugin_is_missing_is_named(tmp_path: Path) -> None:
    write_checkpoint(tmp_path / "act")
    path = write_evaluation(tmp_path, "act")
    code = f"""
import joshua_evaluation.plugins as plugins
from joshua.planner.pipeline import examine
from joshua.planner.request import Request
class Empty:
    def find(self, *args): return None
plugins.load_registry = Empty
print([(e.message, e.remedy) for e in examine(Request({str(path)!r})).errors])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "requires the plugin joshua-lerobot, which is not installed" in done.stdout
    assert "./run --with lerobot" in done.stdout


def test_what_is_found_is_no_warning_of_a_valid_file(tmp_path: Path, random_policy: Path) -> None:
    path = write_evaluation(tmp_path, random_policy)
    found = examine(Request(str(path), purpose=Purpose.LAUNCH)).diagnostics
    assert [item for item in found if item.severity is not Severity.NOTE] == []

"""A checkpoint that normalises what it has no statistics for, before anything starts."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from checkpoints import write_checkpoint, write_robot, write_tensors
from joshua.tools import check
from joshua_lerobot.safetensors import table


def findings(path: Path) -> list[tuple[str, str, str]]:
    """Message, field and remedy of each error."""
    return [(item.message, item.field_path, item.remedy) for item in check(path).errors]


@pytest.fixture
def weights(tmp_path: Path) -> Path:
    return write_checkpoint(tmp_path / "act")


def without(folder: Path, processor: str, *keys: str, renamed: str = "") -> None:
    """Removes statistics of features from a processor, or keeps them under another name."""
    (path,) = folder.glob(f"policy_{processor}_step*")
    kept = {}
    for name, values in table(path).items():
        key, _, statistic = name.rpartition(".")
        if key not in keys:
            kept[name] = list(values)
        elif renamed:
            kept[f"{renamed}.{statistic}"] = list(values)
    write_tensors(path, kept)


@pytest.mark.parametrize(
    ("processor", "key", "effect"),
    [
        ("postprocessor", "action", "the arm would receive the numbers of the network instead of positions"),
        ("preprocessor", "observation.state", "the network would receive numbers on another scale"),
    ],
)
def test_missing_statistics_are_an_error_that_a_field_accepts(
    tmp_path: Path, weights: Path, processor: str, key: str, effect: str
):
    without(weights, processor, key)
    ((message, field, remedy),) = findings(write_robot(tmp_path / "robot.pbtxt", "act"))
    assert message.startswith(f"{weights} normalises {key} and has no statistics for it, so ")
    assert effect in message
    assert field == "ai.models[0]"
    accepted = f'allow_unnormalized: ["{key}"]'
    assert accepted in remedy
    block = f"plugin_config {{ [joshua/joshua.LeRobotPolicy] {{ {accepted} }} }}"
    assert findings(write_robot(tmp_path / "robot.pbtxt", "act", block=block)) == []


def test_statistics_under_another_name_are_named(tmp_path: Path, weights: Path):
    without(weights, "postprocessor", "action", renamed="so100.buffer.action")
    ((message, _, _),) = findings(write_robot(tmp_path / "robot.pbtxt", "act"))
    assert "has no statistics for it (it has statistics of so100.buffer.action), so the arm" in message


def test_statistics_of_one_processor_do_not_excuse_the_other(tmp_path: Path, weights: Path):
    (after,) = weights.glob("policy_postprocessor_step*")
    write_tensors(after, {})  # those of the action are still in the preprocessor
    ((message, _, _),) = findings(write_robot(tmp_path / "robot.pbtxt", "act"))
    assert f"{weights} normalises action and" in message


def test_a_processor_that_knows_a_feature_by_another_name_leaves_it_as_it_is(tmp_path: Path, weights: Path):
    path = weights / "policy_preprocessor.json"
    content = json.loads(path.read_text())
    features = content["steps"][0]["config"]["features"]
    features["observation.joints"] = features.pop("observation.state")
    path.write_text(json.dumps(content))
    ((message, _, _),) = findings(write_robot(tmp_path / "robot.pbtxt", "act"))
    assert f"{weights} normalises observation.state and" in message


def test_a_processor_without_a_normaliser_is_held_against_what_the_policy_declares(tmp_path: Path):
    declared = {"STATE": "IDENTITY", "VISUAL": "IDENTITY", "ACTION": "MIN_MAX"}
    folder = write_checkpoint(tmp_path / "act", normalization_mapping=declared)
    for name in ("policy_preprocessor.json", "policy_postprocessor.json"):
        (folder / name).write_text(json.dumps({"name": name, "steps": []}))
    ((message, _, _),) = findings(write_robot(tmp_path / "robot.pbtxt", "act"))
    assert f"{folder} normalises action and" in message
    write_checkpoint(folder, normalization_mapping=declared | {"ACTION": "IDENTITY"})
    for name in ("policy_preprocessor.json", "policy_postprocessor.json"):
        (folder / name).write_text(json.dumps({"name": name, "steps": []}))
    assert findings(write_robot(tmp_path / "robot.pbtxt", "act")) == []


def test_identity_needs_no_statistics(tmp_path: Path, weights: Path):
    for processor in ("preprocessor", "postprocessor"):
        path = weights / f"policy_{processor}.json"
        path.write_text(path.read_text().replace("MEAN_STD", "IDENTITY"))
        without(weights, processor, "observation.state", "action")
    assert findings(write_robot(tmp_path / "robot.pbtxt", "act")) == []


def test_an_accepted_feature_that_the_policy_does_not_have_is_named(tmp_path: Path, weights: Path):
    block = 'plugin_config { [joshua/joshua.LeRobotPolicy] { allow_unnormalized: "actions" } }'
    ((message, field, _),) = findings(write_robot(tmp_path / "robot.pbtxt", "act", block=block))
    assert "actions is not a feature of" in message
    assert field.endswith("allow_unnormalized")

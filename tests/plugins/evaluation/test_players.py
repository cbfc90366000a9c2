"""Players and the environments that they do not fit."""

from __future__ import annotations

import importlib
import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from evaluation_files import write_evaluation
from joshua_evaluation.checkpoints import CheckpointError
from joshua_evaluation.episodes import Arena
from joshua_evaluation.players import ModelPlayer, PolicyPlayer
from joshua_evaluation.plugins import ModelOffer
from safetensors.numpy import load_file, save_file
from trained_policies import write_policy

REACH = "joshua/SoArm100Reach-v0"

TOY = Path(__file__).resolve().parents[2] / "support" / "toy_policy"

#: An environment of a third party, which has one way to act.
TORQUES = """
from joshua_mujoco_sim.envs import make_vector_environment

def make(environment_id, *, action_mode="", **options):
    return make_vector_environment(environment_id, **options)
"""

#: A model that looks back two steps, and holds each of its chunks for four.
LOOKS_BACK = """
import numpy as np
from joshua.api import Model
from joshua.api.models import ModelNeeds

class LooksBack(Model):
    seen = []

    def load(self): pass
    def reset(self): pass
    def close(self): pass

    def needs(self):
        return ModelNeeds(history=3)

    def act(self, observation):
        assert all(one["observation.state"].shape == (6,) for one in observation.earlier)
        self.seen.append([round(one.stamp_ns / 4e7) for one in (observation, *observation.earlier)])
        return np.zeros((4, 6))
"""


def test_a_policy_of_fewer_joints_is_refused(tmp_path: Path) -> None:
    folder = write_policy(tmp_path / "short")
    weights, about = (
        load_file(folder / "policy.safetensors"),
        json.loads((folder / "policy.json").read_text()),
    )
    for name in ("action_net.weight", "action_net.bias"):
        weights[name] = np.ascontiguousarray(weights[name][:5])
    save_file(weights, folder / "policy.safetensors")
    about |= {name: about[name][:5] for name in ("action_low", "action_high")}
    (folder / "policy.json").write_text(json.dumps(about))
    arena = Arena("joshua_mujoco_sim.envs:make_vector_environment", REACH, "reach")
    with pytest.raises(
        CheckpointError,
        match=r"short returns 5 numbers, but the environment expects 6: name a checkpoint that was trained",
    ):
        PolicyPlayer(folder).load(arena)
    arena.close()


def test_a_model_commands_joints_in_radians_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "torques.py").write_text(TORQUES)
    monkeypatch.syspath_prepend(str(tmp_path))
    player = ModelPlayer(ModelOffer(block="acme.Policy", implementation="acme:Policy"))
    arena = Arena("torques:make", "joshua/Ant-v0", "", **player.options)
    with pytest.raises(
        CheckpointError,
        match=r"acme.Policy commands joints in radians, but the environment takes other actions: choose",
    ):
        player.load(arena)
    player.close()
    arena.close()


def test_a_model_that_looks_back_gets_the_steps_before_of_its_episode(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "looks_back.py").write_text(LOOKS_BACK)
    monkeypatch.syspath_prepend(str(tmp_path))
    player = ModelPlayer(ModelOffer(block="acme.Policy", implementation="looks_back:LooksBack"))
    arena = Arena("joshua_mujoco_sim.envs:make_vector_environment", REACH, "reach", **player.options)
    assert arena.period_s == pytest.approx(0.04)
    player.load(arena)
    for seed in (1, 2):
        player.begin(seed)
        observation = arena.reset(seed)
        for step in range(9):
            observation = arena.step(player.act(arena, observation, step)[0])[0]
    player.close()
    arena.close()
    seen = importlib.import_module("looks_back").LooksBack.seen
    assert seen == [[0, 0, 0], [4, 3, 2], [8, 7, 6]] * 2


def test_a_model_plugin_that_cannot_be_imported_is_named_at_the_line_of_its_checkpoint(
    tmp_path: Path, random_policy: Path
) -> None:
    shutil.copytree(TOY, tmp_path / "plugins")
    settings = tmp_path / "plugins" / "toy_policy" / "settings.py"
    settings.write_text(f"{settings.read_text()}\nimport acme_missing\n")
    block = "videos: 0 plugin_config { [test/toy.PolicyConfig] { } }"
    path = write_evaluation(tmp_path, random_policy, block)
    code = f"""
import sys
sys.path.insert(0, {str(tmp_path / "plugins")!r})
from joshua.planner.pipeline import examine
from joshua.planner.request import Request
for error in examine(Request({str(path)!r})).errors:
    print(error.field_path, error.message, error.remedy)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert (
        "ai.training.eval_config.model_checkpoint The plugin that runs toy.PolicyConfig is brok"
        in done.stdout
    )
    assert "acme_missing" in done.stdout
    assert "Reinstall it." in done.stdout

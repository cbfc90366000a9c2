"""Exported policies: the same actions as the policies, without PyTorch, and what cannot be exported."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tiny_policies
import torch
from joshua_lerobot.checkpoint import CheckpointError
from joshua_lerobot.policy import LeRobotModel
from joshua_lerobot.settings import LeRobotSettings
from joshua_onnx.exporting import export
from joshua_onnx.model import OnnxModel
from joshua_onnx.settings import OnnxSettings
from joshua_ppo_trainer.acting import PpoModel
from joshua_ppo_trainer.acting_settings import PpoPolicySettings
from joshua_ppo_trainer.policy import Policy
from joshua_ppo_trainer.shipped import REACH
from safetensors.torch import save_file
from test_policies import JOINTS, model_of, observation


@pytest.fixture(scope="module")
def act(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A policy and its export."""
    folder = tmp_path_factory.mktemp("policies")
    tiny_policies.make_act(folder / "act")
    said = list(export(folder / "act", folder / "onnx"))
    assert "largest difference" in said[0]
    assert "no dataset.json beside the policy" in said[1]
    return folder / "act", folder / "onnx"


def test_an_exported_act_acts_as_the_policy(act: tuple[Path, Path]) -> None:
    policy = model_of(LeRobotModel, LeRobotSettings, act[0])
    exported = model_of(OnnxModel, OnnxSettings, act[1])
    for seed in range(3):
        wanted, given = (model.act(observation(seed)) for model in (policy, exported))
        assert given.shape == (20, 6)
        np.testing.assert_allclose(given, wanted, atol=1e-4, rtol=0)
    assert exported.needs().action == policy.needs().action
    assert [item.key for item in exported.needs().features] == [item.key for item in policy.needs().features]
    policy.close()
    exported.close()


def test_an_exported_policy_runs_without_torch(act: tuple[Path, Path]) -> None:
    program = f"""
import sys
sys.modules["torch"] = sys.modules["lerobot"] = None
import numpy as np
from joshua.api import JointSpace, Observation
from joshua_onnx.model import OnnxModel
from joshua_onnx.settings import OnnxSettings
from joshua_ppo_trainer.acting import PpoModel
from joshua_ppo_trainer.acting_settings import PpoPolicySettings
from joshua_ppo_trainer.policy import Policy
model = OnnxModel(OnnxSettings(weights={str(act[1])!r}), JointSpace(tuple("abcdef"), -np.ones(6), np.ones(6)))
model.load()
picture = np.zeros((96, 96, 3), np.uint8)
values = {{"observation.state": np.zeros(6, np.float32), "observation.images.top": picture,
          "observation.images.wrist": picture}}
print(model.act(Observation(1, values)).shape)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "(20, 6)", done.stderr


def write_mlp(folder: Path) -> Path:
    """A policy as the PPO of this project keeps it: two inputs, one hidden layer."""
    folder.mkdir()
    draw = torch.Generator().manual_seed(0)
    weights = {"observation.mean": torch.rand(9, generator=draw), "observation.std": torch.full((9,), 2.0)}
    for i, (outputs, inputs) in enumerate([(16, 9), (6, 16)]):
        weights[f"layers.{i}.weight"] = torch.randn(outputs, inputs, generator=draw)
        weights[f"layers.{i}.bias"] = torch.randn(outputs, generator=draw)
    save_file(weights, folder / "model.safetensors")
    seen = {"observation.state": {"type": "STATE", "shape": [6]}}
    seen["observation.goal"] = {"type": "ENV", "shape": [3]}
    config: dict[str, Any] = {
        "type": "mlp",
        "activation": "tanh",
        "input_features": seen,
        "clip_observation": 5.0,
    }
    config |= {"output_features": {"action": {"type": "ACTION", "shape": [6]}}}
    config |= {"action_low": [-1.0] * 6, "action_high": [1.0] * 6}
    (folder / "config.json").write_text(json.dumps(config))
    return folder


def test_a_network_of_layers_acts_as_written(tmp_path: Path) -> None:
    from safetensors.numpy import load_file

    folder = write_mlp(tmp_path / "mlp")
    list(export(folder, tmp_path / "onnx"))
    model = model_of(OnnxModel, OnnxSettings, tmp_path / "onnx")
    seen = observation()
    goal = np.array([0.1, 0.2, 0.3], np.float32)
    values = {"observation.state": seen["observation.state"], "observation.goal": goal}
    given = model.act(type(seen)(1, values, {}))
    w = load_file(folder / "model.safetensors")
    x = np.concatenate([values["observation.state"], goal])
    x = np.clip((x - w["observation.mean"]) / w["observation.std"], -5, 5)
    x = w["layers.1.weight"] @ np.tanh(w["layers.0.weight"] @ x + w["layers.0.bias"]) + w["layers.1.bias"]
    np.testing.assert_allclose(given, np.clip(x, -1, 1)[None], atol=1e-5)
    assert model.needs().action.unit == "rad"
    model.close()


def test_what_cannot_be_exported_says_why(act: tuple[Path, Path], tmp_path: Path) -> None:
    tiny_policies.make_diffusion(tmp_path / "diffusion")
    with pytest.raises(CheckpointError, match="holds a policy of type 'diffusion'; only act and mlp can"):
        list(export(tmp_path / "diffusion", tmp_path / "onnx"))
    with pytest.raises(CheckpointError, match="is not empty, and nothing is overwritten"):
        list(export(act[0], act[1]))
    folder = write_mlp(tmp_path / "mlp")
    config = json.loads((folder / "config.json").read_text())
    (folder / "config.json").write_text(json.dumps(config | {"activation": "magic"}))
    with pytest.raises(CheckpointError, match="is not a network of layers"):
        list(export(folder, tmp_path / "onnx"))
    (folder / "model.safetensors").rename(folder / "policy.pt")
    with pytest.raises(CheckpointError, match="a pickle, which executes what it contains"):
        list(export(folder, tmp_path / "onnx"))


def test_the_command_exports(act: tuple[Path, Path], tmp_path: Path) -> None:
    program = "import joshua.cli.main as m, sys; sys.exit(m.main(sys.argv[1:]))"
    words = ["policy", "export", str(act[0]), str(tmp_path / "onnx")]
    done = subprocess.run(
        [sys.executable, "-c", program, *words],
        capture_output=True,
        text=True,
        env={**os.environ},
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "onnx" / "policy.onnx").is_file()
    assert "largest difference" in done.stdout


@pytest.mark.parametrize(
    ("algorithm", "activation", "normalised"),
    [("PPO", "tanh", False), ("PPO", "elu", True), ("SAC", "relu", True)],
)
def test_a_policy_of_ppo_is_exported_and_acts_the_same(
    tmp_path: Path, algorithm: str, activation: str, normalised: bool
) -> None:
    draw = np.random.default_rng(0)
    run = tmp_path / "run"
    step = run / "checkpoints" / "step_000000000100"
    step.mkdir(parents=True)
    (run / "run.json").write_text("{}")
    about = json.loads((REACH / "policy.json").read_text())
    moments = {"mean": draw.normal(0, 1, 30).tolist(), "variance": draw.uniform(0.5, 2, 30).tolist()}
    about |= {"algorithm": algorithm, "activation": activation}
    about |= {"normalisation": moments if normalised else None}
    (step / "policy.json").write_text(json.dumps(about))
    hidden = {"PPO": "mlp_extractor.policy_net", "SAC": "actor.latent_pi"}[algorithm]
    last = {"PPO": "action_net", "SAC": "actor.mu"}[algorithm]
    shapes = {f"{hidden}.0": (16, 30), f"{hidden}.2": (16, 16), last: (6, 16)}
    weights = {
        f"{name}.weight": torch.tensor(draw.normal(0, 0.5, shape)).float() for name, shape in shapes.items()
    }
    weights |= {
        f"{name}.bias": torch.tensor(draw.normal(0, 0.5, shape[0])).float() for name, shape in shapes.items()
    }
    save_file(weights, step / "policy.safetensors")
    said = list(export(run, tmp_path / "onnx"))
    assert "largest difference" in said[0]
    assert "[joshua/joshua.PpoPolicy]" in said[1]
    settings = PpoPolicySettings(weights=str(tmp_path / "onnx"), goal_m=(0.1, -0.2, 0.15), rate_hz=25.0)
    model = PpoModel(settings, JOINTS)
    model.load()
    seen = draw.normal(0, 1, (1, 30)).astype(np.float32)
    np.testing.assert_allclose(model._network(seen), Policy.load(step).act(seen), atol=1e-5)
    assert settings.needs().libraries == ("gymnasium", "mujoco", "onnxruntime")
    model.reset()
    model.close()


def test_a_run_without_a_policy_cannot_be_exported(tmp_path: Path) -> None:
    (tmp_path / "run.json").write_text("{}")
    with pytest.raises(CheckpointError, match="contains no policy of joshua-ppo-trainer"):
        list(export(tmp_path, tmp_path / "onnx"))

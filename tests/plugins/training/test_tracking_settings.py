"""What a file says of Weights & Biases and MLflow, and what is missing at the launch."""

from __future__ import annotations

from pathlib import Path

import pytest
from joshua.api import FieldErrors
from joshua.planner.pipeline import examine
from joshua.planner.request import Purpose, Request
from joshua.schema import config_pb2 as pb
from joshua_evaluation.settings import EvaluationSettings
from joshua_ppo_trainer.settings import TrainerSettings
from joshua_training.tracking_settings import TrackingSettings
from pydantic import ValidationError

FILE = """
general {{ mode: MODE_TRAINING name: "train" id: "train-tracked" }}
ai {{
  training {{
    environment: ENV_SIMULATION method: METHOD_RL simulator_backend: BACKEND_MUJOCO
    environment_id: "joshua/SoArm100Reach-v0"
    {tracking}
    rl_config {{
      algorithm: "PPO" num_envs: 4 total_timesteps: 100 learning_rate: 0.001 gamma: 0.9 batch_size: 8
    }}
  }}
}}
"""


@pytest.fixture(autouse=True)
def nothing_in_the_environment(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name in ("WANDB_API_KEY", "WANDB_MODE", "WANDB_BASE_URL", "MLFLOW_TRACKING_URI"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("NETRC", str(tmp_path / "netrc"))


def errors(folder: Path, tracking: str, purpose: Purpose = Purpose.LAUNCH):
    path = folder / "train.pbtxt"
    path.write_text(FILE.format(tracking=tracking))
    return [item for item in examine(Request(str(path), purpose=purpose)).errors if "extra" in item.code]


def test_a_block_chooses_a_service_and_has_defaults() -> None:
    block = pb.Training(environment=pb.ENV_SIMULATION, rl_config=pb.RLConfig(algorithm="PPO"))
    assert TrainerSettings.from_block(block).tracking.names == ()
    block.wandb.entity = "lab"
    block.mlflow.server = "http://localhost:5000"
    tracking = TrainerSettings.from_block(block).tracking
    assert tracking.names == ("wandb", "mlflow")
    assert (tracking.wandb.project, tracking.wandb.entity, tracking.wandb.offline) == ("joshua", "lab", False)
    assert tracking.mlflow.server == "http://localhost:5000"


def test_a_folder_of_mlflow_is_relative_to_the_file(tmp_path: Path) -> None:
    assert TrackingSettings.of({"mlflow": {"server": "kept"}}, tmp_path).mlflow.server == str(
        tmp_path / "kept"
    )
    assert TrackingSettings.of({"mlflow": {}}, tmp_path).mlflow.server == ""


@pytest.mark.parametrize("name", ["wandb", "mlflow"])
def test_a_missing_package_is_said_before_the_launch_and_not_at_a_validation(
    tmp_path: Path, name: str
) -> None:
    block = f"{name} {{ {'offline: true' if name == 'wandb' else ''} }}"
    (error,) = errors(tmp_path, block)
    assert error.code == "extra-missing"
    assert error.field_path == f"ai.training.{name}"
    assert error.position.line == 7
    assert error.message.startswith(f"{name} requires the package {name}, which ")
    assert f"training[{name}]" in error.remedy
    assert not errors(tmp_path, block, Purpose.VALIDATE)


def test_a_login_comes_from_the_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def lacks() -> str:
        with pytest.raises(FieldErrors) as raised:
            TrackingSettings.of({"wandb": {"server": "https://wandb.example.org"}}, tmp_path).require()
        return str(raised.value)

    assert "There is no login for wandb.example.org in the environment" in lacks()
    (tmp_path / "netrc").write_text("machine other.example.org login user password secret\n")
    assert "no login" in lacks()
    (tmp_path / "netrc").write_text("machine wandb.example.org login user password secret\n")
    assert "no login" not in lacks()
    (tmp_path / "netrc").write_text("")
    monkeypatch.setenv("WANDB_API_KEY", "0" * 40)
    assert "no login" not in lacks()
    monkeypatch.delenv("WANDB_API_KEY")
    monkeypatch.setenv("WANDB_MODE", "offline")
    assert "no login" not in lacks()


def test_an_evaluation_refuses_a_service() -> None:
    block = pb.Training(environment=pb.ENV_SIMULATION, environment_id="joshua/SoArm100Reach-v0")
    block.eval_config.num_episodes = 1
    block.wandb.SetInParent()
    with pytest.raises(ValidationError, match="wandb records trainings only"):
        EvaluationSettings.from_block(block)

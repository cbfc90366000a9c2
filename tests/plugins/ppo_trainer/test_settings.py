"""What a validation says of a training by PPO or SAC; nothing heavy is imported for it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from joshua.planner.pipeline import examine
from joshua.planner.request import Purpose, Request
from joshua.schema import config_pb2 as pb
from joshua_ppo_trainer.settings import SUITABLE, Suitable, TrainerSettings


def training(
    rl: str = "", *, head: str = "environment: ENV_SIMULATION simulator_backend: BACKEND_MUJOCO"
) -> str:
    return f"""
general {{ mode: MODE_TRAINING name: "train" id: "train-ppo-test" }}
simulation {{ mode: OFFSCREEN model_path: "so_arm100/reach.xml" seed: 3 }}
ai {{
  training {{
    {head}
    method: METHOD_RL
    environment_id: "joshua/SoArm100Reach-v0"
    rl_config {{
      {"" if "algorithm" in rl else 'algorithm: "PPO"'}
      num_envs: 4 total_timesteps: 100 learning_rate: 0.001 gamma: 0.9
      {"" if "batch_size" in rl else "batch_size: 8"} {rl}
    }}
  }}
}}
"""


def errors(folder: Path, text: str):
    path = folder / "train.pbtxt"
    path.write_text(text)
    return examine(Request(str(path), purpose=Purpose.VALIDATE)).errors


def settings(**fields) -> TrainerSettings:
    block = pb.Training(
        environment=pb.ENV_SIMULATION, rl_config=pb.RLConfig(algorithm="PPO", num_envs=64, **fields)
    )
    return TrainerSettings.from_block(block)


def test_a_training_is_valid_without_anything_heavy(tmp_path: Path) -> None:
    (tmp_path / "train.pbtxt").write_text(training())
    code = f"""
import sys
from joshua.planner.pipeline import examine
from joshua.planner.request import Purpose, Request
assert not examine(Request({str(tmp_path / "train.pbtxt")!r}, purpose=Purpose.VALIDATE)).errors
print(sorted({{"torch", "stable_baselines3", "gymnasium", "numpy", "safetensors"}} & set(sys.modules)))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_learning_on_a_robot_is_refused_with_the_reason(tmp_path: Path) -> None:
    text = training(head="environment: ENV_REAL")
    (error,) = (e for e in errors(tmp_path, text) if e.field_path == "ai.training.environment")
    assert error.message.startswith("JOSHUA runs no reinforcement learning on a robot: it explores by random")
    assert error.allowed == ("ENV_SIMULATION",)
    assert "METHOD_IMITATION" in error.remedy
    assert error.position.line == 6


def test_an_unknown_algorithm_is_named_with_the_known(tmp_path: Path) -> None:
    (error,) = errors(tmp_path, training('algorithm: "SARSA"'))
    assert error.field_path == "ai.training.rl_config.algorithm"
    assert error.message == "There is no algorithm 'SARSA'."
    assert error.allowed == ("SAC", "PPO")
    assert error.remedy == 'Write algorithm: "SAC".'


@pytest.mark.parametrize(
    ("fields", "name", "remedy"),
    [
        (
            'algorithm: "PPO" buffer_size: 1000',
            "buffer_size",
            'Remove buffer_size, or write algorithm: "SAC".',
        ),
        ('algorithm: "PPO" tau: 0.01', "tau", 'Remove tau, or write algorithm: "SAC".'),
        ('algorithm: "SAC" clip_range: 0.3', "clip_range", 'Remove clip_range, or write algorithm: "PPO".'),
        ('algorithm: "SAC" n_epochs: 3', "n_epochs", 'Remove n_epochs, or write algorithm: "PPO".'),
    ],
)
def test_a_field_of_the_other_algorithm_is_refused(
    tmp_path: Path, fields: str, name: str, remedy: str
) -> None:
    (error,) = errors(tmp_path, training(fields))
    assert error.field_path == f"ai.training.rl_config.{name}"
    assert "has no effect with" in error.message
    assert error.remedy == remedy


@pytest.mark.parametrize("algorithm", ["PPO", "SAC"])
def test_defaults_belong_to_both_algorithms(tmp_path: Path, algorithm: str) -> None:
    shared = "tau: 0.005 buffer_size: 300000" if algorithm == "PPO" else "clip_range: 0.2 value_weight: 0.5"
    assert not errors(tmp_path, training(f'algorithm: "{algorithm}" {shared}'))


def test_the_setting_that_halves_the_memory_is_known() -> None:
    assert settings().halves() == "halve num_envs, to 32, or n_steps"
    block = pb.Training(rl_config=pb.RLConfig(algorithm="SAC", num_envs=4, buffer_size=9))
    assert TrainerSettings.from_block(block).halves() == "halve buffer_size, to 4"


def test_a_batch_that_never_fills_is_refused(tmp_path: Path) -> None:
    (error,) = errors(tmp_path, training("n_steps: 8 batch_size: 64"))
    assert (
        "a batch of 64 samples is larger than what 4 environments collect in 8 steps, 32"
        in error.message.lower()
    )


def test_a_batch_of_one_sample_is_refused(tmp_path: Path) -> None:
    """Its advantage less the mean is 0, and its spread no number, which would end the run at once."""
    (error,) = errors(tmp_path, training("n_steps: 8 batch_size: 1"))
    assert error.field_path == "ai.training.rl_config.batch_size"
    assert "advantages of a mini-batch to unit size, which one sample has not" in error.message
    assert error.remedy == "Write 2 or more, 1024 for example."
    assert not errors(tmp_path, training('algorithm: "SAC" batch_size: 1'))


def test_folders_are_relative_to_the_file() -> None:
    from joshua.plugins.block_context import BlockContext

    block = pb.Training(environment=pb.ENV_SIMULATION, rl_config=pb.RLConfig(resume_run="runs/a"))
    made = TrainerSettings.from_block(block, context=BlockContext(folder="/robots"))
    assert (made.output_folder, made.resume_run) == ("/robots/runs", "/robots/runs/a")


def test_what_is_omitted_suits_the_environment() -> None:
    ours = settings().suitable("joshua/SoArm100Reach-v0")
    assert {name: getattr(ours, name) for name in vars(Suitable())} == vars(
        SUITABLE["joshua/SoArm100Reach-v0"]
    )
    assert settings().suitable("acme/Other-v0").normalize_observations is True
    chosen = settings(
        n_steps=5, hidden_sizes=[7], normalize_rewards=False, entropy_weight=0.0, gae_lambda=0.0
    )
    other = chosen.suitable("joshua/Ant-v0")
    assert (other.n_steps, other.hidden_sizes, other.normalize_rewards) == (5, (7,), False)
    assert (other.entropy_weight, other.gae_lambda) == (0.0, 0.0)

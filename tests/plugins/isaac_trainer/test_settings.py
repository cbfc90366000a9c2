"""What a validation and a launch say of a training in Isaac Lab, and what its fields become in rsl_rl."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest
from joshua.cli.exit_codes import ExitCode
from joshua.cli.report import exit_code_of
from joshua.planner.pipeline import examine
from joshua.planner.request import Purpose, Request
from joshua.schema import config_pb2 as pb
from joshua_isaac_trainer import settings as settings_module
from joshua_isaac_trainer.machine import UNFIT, Gpu, Machine
from joshua_isaac_trainer.settings import IsaacSettings

PRESET = Path(__file__).resolve().parents[3] / "configs" / "training_rl_isaac.pbtxt"

BARE = Machine("Linux", "x86_64", (3, 11), None, None, None, None, (), False)


def examined(*overrides: str, purpose: Purpose = Purpose.VALIDATE):
    return examine(Request(str(PRESET), purpose=purpose, overrides=overrides))


def settings(**fields) -> IsaacSettings:
    wanted = {"algorithm": "PPO", "num_envs": 64, "batch_size": 192, **fields}
    return IsaacSettings.from_block(
        pb.Training(environment=pb.ENV_SIMULATION, rl_config=pb.RLConfig(**wanted))
    )


def test_a_launch_lists_everything_that_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(settings_module, "look", lambda: BARE)
    result = examined(purpose=Purpose.LAUNCH)
    assert [(item.code, item.message.partition(" for ")[0].partition(":")[0]) for item in result.errors] == [
        ("extra-missing", "Isaac Sim is not installed"),
        ("extra-missing", "Isaac Lab is not installed."),
        ("extra-missing", "rsl_rl is not installed."),
        (UNFIT, "There is no NVIDIA driver"),
    ]
    assert {item.field_path for item in result.errors} == {"ai.training.simulator_backend"}
    assert all(item.position is not None and item.remedy for item in result.errors)
    assert exit_code_of(result) is ExitCode.HARDWARE


def test_missing_packages_alone_have_another_exit_code(monkeypatch: pytest.MonkeyPatch) -> None:
    able = replace(BARE, driver="580.95.05", gpus=(Gpu("NVIDIA RTX A6000", 49_140),))
    monkeypatch.setattr(settings_module, "look", lambda: able)
    assert exit_code_of(examined(purpose=Purpose.LAUNCH)) is ExitCode.NOT_INSTALLED


def test_a_task_without_a_scene_is_refused() -> None:
    found = examined(
        'ai.training.environment_id="joshua/Ant-v0"', 'ai.training.rl_config.reward_function="forward"'
    ).errors
    (error,) = found
    assert error.message == "joshua/Ant-v0 is not built for Isaac Lab."
    assert error.allowed == settings_module.TASKS


def test_fields_become_those_of_rsl_rl() -> None:
    made = settings(
        n_steps=12, n_epochs=3, gae_lambda=0.9, entropy_weight=0.01, value_weight=0.7, max_grad_norm=2.0,
        hidden_sizes=[32, 16], activation="relu", initial_log_std=-1.0, normalize_observations=True,
        learning_rate=0.002, gamma=0.97, clip_range=0.3,
    )  # fmt: skip
    runner = made.runner()
    assert runner["num_steps_per_env"] == 12
    policy, algorithm = runner["policy"], runner["algorithm"]
    assert policy["actor_hidden_dims"] == policy["critic_hidden_dims"] == [32, 16]
    assert policy["init_noise_std"] == pytest.approx(math.exp(-1.0))
    assert (policy["activation"], policy["actor_obs_normalization"]) == ("relu", True)
    assert algorithm["num_mini_batches"] == 4  # 64 * 12 / 192
    assert (algorithm["num_learning_epochs"], algorithm["schedule"]) == (3, "fixed")
    for name, value in (
        ("lam", 0.9), ("entropy_coef", 0.01), ("value_loss_coef", 0.7), ("max_grad_norm", 2.0),
        ("learning_rate", 0.002), ("gamma", 0.97), ("clip_param", 0.3),
    ):  # fmt: skip
        assert algorithm[name] == pytest.approx(value, rel=1e-6)
    adaptive = settings(target_kl=0.02).runner()["algorithm"]
    assert (adaptive["schedule"], adaptive["desired_kl"]) == ("adaptive", pytest.approx(0.02))

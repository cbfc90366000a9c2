"""What a validation says of a training by reinforcement, with each trainer; it imports nothing heavy."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from joshua.planner.pipeline import examine
from joshua.planner.request import Purpose, Request
from joshua.plugins.block_context import BlockContext
from joshua.schema import config_pb2 as pb
from joshua_isaac_trainer.settings import IsaacSettings
from joshua_mjx_trainer.settings import MjxSettings
from joshua_ppo_trainer.settings import TrainerSettings
from joshua_training.rl_settings import PPO_ONLY, SAC_ONLY, RlSettings, Suitable

CONFIGS = Path(__file__).resolve().parents[3] / "configs"
TRAINERS: dict[str, type[RlSettings]] = {"ppo": TrainerSettings, "mjx": MjxSettings, "isaac": IsaacSettings}
HEAVY = {"jax", "torch", "gymnasium", "mujoco", "numpy", "safetensors", "stable_baselines3", "rsl_rl"}

each_trainer = pytest.mark.parametrize("trainer", TRAINERS)


def errors(trainer: str, *fields: str) -> Any:
    overrides = tuple(f"ai.training.{field}" for field in fields)
    preset = str(CONFIGS / f"training_rl_{trainer}.pbtxt")
    return examine(Request(preset, purpose=Purpose.VALIDATE, overrides=overrides)).errors


def settings(trainer: str = "ppo", **fields: Any) -> RlSettings:
    block = pb.RLConfig(**{"algorithm": "PPO", "num_envs": 64, "batch_size": 64, **fields})
    return TRAINERS[trainer].from_block(pb.Training(environment=pb.ENV_SIMULATION, rl_config=block))


@each_trainer
def test_the_preset_is_valid_without_anything_heavy(trainer: str) -> None:
    code = f"""
import sys
from joshua.planner.pipeline import examine
from joshua.planner.request import Purpose, Request
preset = {str(CONFIGS / f"training_rl_{trainer}.pbtxt")!r}
assert not examine(Request(preset, purpose=Purpose.VALIDATE)).errors
print(sorted({HEAVY} & set(sys.modules)))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@each_trainer
def test_learning_on_a_robot_is_refused_with_the_reason(trainer: str) -> None:
    (error,) = errors(trainer, "environment=ENV_REAL")
    assert error.field_path == "ai.training.environment"
    assert error.message.startswith("JOSHUA runs no reinforcement learning on a robot: it explores by random")
    assert error.allowed == ("ENV_SIMULATION",)
    assert "METHOD_IMITATION" in error.remedy


WITHOUT_SAC = 'Write algorithm: "PPO", or simulator_backend: BACKEND_MUJOCO.'


@pytest.mark.parametrize(
    ("trainer", "override", "message", "remedy"),
    [
        *(
            (trainer, 'algorithm="PPPO"', "There is no algorithm 'PPPO'.", 'Write algorithm: "PPO".')
            for trainer in TRAINERS
        ),
        ("ppo", 'algorithm="SARSA"', "There is no algorithm 'SARSA'.", 'Write algorithm: "SAC".'),
        ("mjx", 'algorithm="SAC"', "BACKEND_MJX trains by PPO only.", WITHOUT_SAC),
        ("isaac", 'algorithm="SAC"', "BACKEND_ISAAC trains by PPO only.", WITHOUT_SAC),
        *(
            (trainer, "tau=0.01", "tau has no effect with PPO; it belongs to SAC.", remedy)
            for trainer in ("ppo", "mjx")
            for remedy in ['Remove tau, or write algorithm: "SAC".']
        ),
        (
            "mjx",
            "physics_threads=2",
            "physics_threads has no effect with BACKEND_MJX, because JAX distributes the physics itself.",
            "Remove physics_threads.",
        ),
        (
            "isaac",
            "physics_threads=2",
            "physics_threads has no effect with BACKEND_ISAAC, because PhysX computes on the GPU.",
            "Remove physics_threads.",
        ),
        (
            "isaac",
            "tau=0.01",
            "tau has no effect with BACKEND_ISAAC, because it belongs to SAC.",
            "Remove tau.",
        ),
        *(
            (
                trainer,
                "batch_size=1000000",
                f"A batch of 1000000 samples is larger than what {collected}.",
                "Make it smaller, or raise num_envs or n_steps.",
            )
            for trainer, collected in (
                ("ppo", "64 environments collect in 32 steps, 2048"),
                ("mjx", "2048 environments collect in 32 steps, 65536"),
                ("isaac", "4096 environments collect in 24 steps, 98304"),
            )
        ),
        *(  # its advantage less the mean is 0, and its spread no number, which would end the run at once
            (
                trainer,
                "batch_size=1",
                "PPO brings the advantages of a mini-batch to unit size, which one sample has not.",
                "Write 2 or more, 1024 for example.",
            )
            for trainer in TRAINERS
        ),
    ],
)
def test_what_does_not_fit_is_refused(trainer: str, override: str, message: str, remedy: str) -> None:
    (error,) = errors(trainer, f"rl_config.{override}")
    assert error.field_path == f"ai.training.rl_config.{override.partition('=')[0]}"
    assert (error.message, error.remedy) == (message, remedy)


def test_the_nearest_algorithm_stands_first() -> None:
    assert errors("ppo", 'rl_config.algorithm="SARSA"')[0].allowed == ("SAC", "PPO")
    assert errors("isaac", 'rl_config.algorithm="SARSA"')[0].allowed == ("PPO",)


@pytest.mark.parametrize("name", ["clip_range", "n_epochs"])
def test_a_field_of_ppo_has_no_effect_with_sac(name: str) -> None:
    (error,) = errors("ppo", 'rl_config.algorithm="SAC"', f"rl_config.{name}=1")
    assert error.message == f"{name} has no effect with SAC; it belongs to PPO."
    assert error.remedy == f'Remove {name}, or write algorithm: "PPO".'


@pytest.mark.parametrize(
    ("trainer", "fields"),
    [
        ("ppo", ('algorithm="SAC"', "value_weight=0.5", "batch_size=1", "learning_starts=0")),
        *((trainer, ("tau=0.005", "buffer_size=300000")) for trainer in TRAINERS),
    ],
)
def test_what_changes_nothing_may_stand_there(trainer: str, fields: tuple[str, ...]) -> None:
    assert not errors(trainer, *(f"rl_config.{field}" for field in fields))


def test_the_setting_that_halves_the_memory_is_known() -> None:
    assert settings().halves() == "halve num_envs, to 32, or n_steps"
    assert settings(algorithm="SAC", num_envs=4, buffer_size=9).halves() == "halve buffer_size, to 4"


@each_trainer
def test_folders_are_relative_to_the_file(trainer: str, tmp_path: Path) -> None:
    (tmp_path / "runs" / "a").mkdir(parents=True)
    (tmp_path / "runs" / "a" / "run.json").write_text("{}")
    block = pb.Training(environment=pb.ENV_SIMULATION, rl_config=pb.RLConfig(num_envs=9, resume_run="runs/a"))
    made = TRAINERS[trainer].from_block(block, context=BlockContext(folder=str(tmp_path)))
    assert (made.output_folder, made.resume_run) == (f"{tmp_path}/runs", f"{tmp_path}/runs/a")


@each_trainer
def test_a_run_to_continue_must_exist(trainer: str, tmp_path: Path) -> None:
    for name in ("reach-20261122", "ant-20261122"):
        (tmp_path / "runs" / name).mkdir(parents=True)
        (tmp_path / "runs" / name / "run.json").write_text("{}")
    (tmp_path / "runs" / "empty").mkdir()
    run = tmp_path / "runs" / "reach-20261123"
    (error,) = errors(trainer, f'rl_config.resume_run="{run}"')
    assert error.field_path == "ai.training.rl_config.resume_run"
    assert error.message == (
        f"There is no run 'reach-20261123' in {tmp_path}/runs: a run is a folder with a run.json."
    )
    assert error.allowed == tuple(f"{tmp_path}/runs/{name}" for name in ("reach-20261122", "ant-20261122"))
    assert error.remedy == "Name the folder that a run logs at its start, or remove resume_run."


@each_trainer
def test_what_is_omitted_suits_the_environment(trainer: str) -> None:
    kind = TRAINERS[trainer]
    for name in ("joshua/SoArm100Reach-v0", "acme/Other-v0"):
        ours = settings(trainer).suitable(name)
        found = vars(kind.SUITABLE.get(name, kind.OTHERWISE))
        assert {field: getattr(ours, field) for field in vars(Suitable())} == found
    chosen = settings(
        trainer, n_steps=5, hidden_sizes=[7], normalize_rewards=False, entropy_weight=0.0, gae_lambda=0.0
    )
    other = chosen.suitable("joshua/Ant-v0")
    assert (other.n_steps, other.hidden_sizes, other.normalize_rewards) == (5, (7,), False)
    assert (other.entropy_weight, other.gae_lambda) == (0.0, 0.0)


def test_fields_of_the_other_algorithm_are_no_facts_of_a_run() -> None:
    """Their defaults change without a difference for the run."""
    names = TrainerSettings.model_fields.keys()
    for algorithm, read, others in (("PPO", PPO_ONLY, SAC_ONLY), ("SAC", SAC_ONLY, PPO_ONLY)):
        found = set(settings(algorithm=algorithm).foreign)
        assert found == set(others)
        assert not found & set(read)
        assert found <= names


def test_sac_has_defaults_of_its_own() -> None:
    other = settings(algorithm="SAC").suitable("acme/Other-v0")
    assert (other.hidden_sizes, other.activation, other.learning_starts) == ((256, 256), "relu", 5000)
    assert (other.normalize_observations, other.normalize_rewards, other.n_steps) == (True, False, None)
    reach = "joshua/SoArm100Reach-v0"
    found = vars(TrainerSettings.SUITABLE_SAC[reach])
    ours = settings(algorithm="SAC").suitable(reach)
    assert {field: getattr(ours, field) for field in found} == found
    assert settings(algorithm="SAC", activation="elu").suitable(reach).activation == "elu"


@pytest.mark.parametrize("given", [0, 7])
def test_updates_may_start_at_once(given: int) -> None:
    ours = settings(algorithm="SAC", learning_starts=given).suitable("acme/Other-v0")
    assert ours.learning_starts == given


@each_trainer
def test_a_cluster_is_refused_where_the_file_names_it(trainer: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("RAY_USE_TLS", raising=False)
    (error,) = errors(trainer, 'cluster.address="10.0.0.1:6379"')
    if trainer == "ppo":
        assert error.field_path == "ai.training.cluster.address"
        assert "10.0.0.1:6379 is not on the loopback" in error.message
        assert "RAY_USE_TLS=1" in error.message
    else:
        assert error.message.startswith("A cluster shares the rollouts of PPO with BACKEND_MUJOCO")


def test_only_ppo_in_simulation_takes_a_cluster(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("joshua_ray.executor.check", lambda address: None)
    cluster = 'cluster.address="local"'
    assert not errors("ppo", cluster)
    (error,) = errors("ppo", cluster, 'rl_config.algorithm="SAC"')
    assert error.message.startswith("SAC updates after every step")
    assert error.remedy == 'Remove it, or write algorithm: "PPO".'
    threads = "rl_config.physics_threads"
    assert not errors("ppo", cluster, f"{threads}=1")
    (error,) = errors("ppo", cluster, f"{threads}=2")
    assert error.field_path == f"ai.training.{threads}"
    assert error.message == (
        "physics_threads has no effect on a cluster, because each of its workers has one core."
    )
    assert error.remedy == "Remove physics_threads; cluster.workers is the number of cores."
    robot = errors("ppo", cluster, "environment=ENV_REAL")
    assert any(error.message.startswith("With ENV_REAL, this run drives a robot") for error in robot)

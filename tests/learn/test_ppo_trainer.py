"""PPO and SAC on batched environments: learning, stopping, continuing bit for bit, files without pickle."""

from __future__ import annotations

import contextlib
import functools
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from joshua.planner.pipeline import examine
from joshua.planner.request import Request
from joshua.schema import config_pb2 as pb
from joshua.testing.domain import reserved_domain
from joshua.testing.recording_context import RecordingContext
from joshua_mujoco_sim.envs import make_vector_environment
from joshua_ppo_trainer import checkpoint
from joshua_ppo_trainer.learner import DivergedError, Learner
from joshua_ppo_trainer.node import PpoTrainer
from joshua_ppo_trainer.normalise import Moments
from joshua_ppo_trainer.policy import Policy
from joshua_ppo_trainer.settings import TrainerSettings
from joshua_ppo_trainer.vec_env import BatchedVecEnv
from joshua_training import run_folder
from joshua_training.run_folder import RunError, RunFolder
from learner_behaviours import LearnerBehaviours, differ
from safetensors.numpy import load_file

REACH = "joshua/SoArm100Reach-v0"
SMALL: dict[str, Any] = {
    "algorithm": "PPO",
    "num_envs": 4,
    "total_timesteps": 1000,
    "learning_rate": 0.003,
    "gamma": 0.9,
    "batch_size": 16,
    "n_steps": 8,
    "n_epochs": 2,
}

torch.set_num_threads(1)
_RESERVED = contextlib.ExitStack()


#: Fields of SMALL that SAC refuses.
OF_PPO = ("n_steps", "n_epochs")


def learner(environment: str = REACH, asked: Callable[[], bool] = lambda: False, **fields: Any) -> Learner:
    small = {
        name: value for name, value in SMALL.items() if fields.get("algorithm") != "SAC" or name not in OF_PPO
    }
    block = pb.Training(environment=pb.ENV_SIMULATION, rl_config=pb.RLConfig(**{**small, **fields}))
    settings = TrainerSettings.from_block(block).suitable(environment)
    options = {"randomise": True} if settings.randomise else {}
    reward = block.rl_config.reward_function
    made = make_vector_environment(
        environment,
        reward_function=reward,
        num_envs=settings.num_envs,
        seed=5,
        autoreset_mode="SameStep",
        **options,
    )
    return Learner(settings, made, 5, asked)


def rows(made: Learner, count: int) -> list[dict[str, float]]:
    found = []
    for _ in range(count):
        row = made.iterate()
        assert row is not None
        found.append({key: value for key, value in row.items() if not key.startswith("rate/")})
    return found


def weights(made: Learner) -> dict[str, Any]:
    return checkpoint.weights_of(made.policy)


def learned(iterations: int = 2, **fields: Any) -> dict[str, Any]:
    """The weights after some iterations. They share random generators: one after the other."""
    made = learner(**fields)
    rows(made, iterations)
    return weights(made)


class TestPpo(LearnerBehaviours):
    STOPS = (3, 12)  # while it collects, and while it updates

    def make(self, asked: Callable[[], bool] = lambda: False, **fields: Any) -> Any:
        return learner(asked=asked, **fields)

    def fill_value(self, made: Any, value: float) -> None:
        made.policy.value_net.weight.data.fill_(value)


@pytest.mark.parametrize(
    "changed",
    [
        {"algorithm": "SAC", "total_timesteps": 24, "learning_starts": 4, "buffer_size": 100},
        {"reward_function": "reach_sparse"},
        {"randomise": True},
    ],
    ids=lambda changed: next(iter(changed)),
)
def test_algorithm_and_environment_take_effect(changed: dict[str, Any]) -> None:
    assert differ(learned(), learned(1 if "algorithm" in changed else 2, **changed))


@pytest.mark.parametrize(
    "changed",
    [{"tau": 0.5}, {"updates_per_step": 3}, {"learning_starts": 40}, {"buffer_size": 8}],
    ids=lambda changed: next(iter(changed)),
)
def test_the_fields_of_sac_take_effect(changed: dict[str, Any]) -> None:
    small = {"algorithm": "SAC", "total_timesteps": 60, "learning_starts": 8, "buffer_size": 400}
    base = learned(1, **{**small, "updates_per_step": 1})
    assert not differ(base, learned(1, **{**small, "updates_per_step": 1}))
    assert differ(base, learned(1, **{**small, "updates_per_step": 1, **changed}))


@pytest.mark.parametrize("environment", [REACH, "joshua/Ant-v0"])
def test_a_learner_goes_on_from_a_checkpoint_bit_for_bit(environment: str, tmp_path: Path) -> None:
    """Weights, optimiser, normalisation, random numbers and physics, with episodes cut in their middle."""
    fields: dict[str, Any] = {"normalize_observations": True, "normalize_rewards": True, "randomise": True}
    whole = learner(environment, **fields)
    expected = rows(whole, 14)
    before = learner(environment, **fields)
    rows(before, 11)
    files = checkpoint.as_files(*before.snapshot(), {"algorithm": "PPO"})
    folder = RunFolder.create(tmp_path, "run", {}).save(before.steps, files)
    torch.manual_seed(99)
    np.random.seed(99)
    after = learner(environment, **fields)
    after.restore(*checkpoint.read(folder))
    assert rows(after, 3) == expected[11:]
    assert not differ(weights(whole), weights(after))


def test_an_action_that_is_no_number_stops_with_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    made = learner()
    rows(made, 1)
    kept = made.snapshot()
    made.policy.action_net.weight.data.fill_(float("nan"))
    for checked in (True, False):  # some libraries switch the checks of torch's distributions off
        monkeypatch.setattr(torch.distributions.Distribution, "_validate_args", checked)
        with pytest.raises(DivergedError, match="an action is not a number"):
            made.iterate()
    assert made.snapshot() is kept


def test_the_policy_of_a_checkpoint_acts_as_the_one_that_learned() -> None:
    for fields in ({"normalize_observations": True}, {"activation": "elu"}, {"activation": "relu"}):
        made = learner(**fields)
        rows(made, 2)
        policy, training, _ = made.snapshot()
        moments = {key: training[f"normalise.observed.{key}"].tolist() for key in ("mean", "variance")}
        about = {
            "algorithm": "PPO",
            "activation": made._settings.activation,
            "action_low": [-1.0] * 6,
            "action_high": [1.0] * 6,
            "normalisation": moments if made._settings.normalize_observations else None,
        }
        observations = np.random.default_rng(0).normal(size=(9, 30)).astype(np.float32)
        seen = made.normaliser.shown(observations)
        expected, _ = made._model.predict(seen, deterministic=True)
        assert Policy(about, policy).act(observations) == pytest.approx(expected, abs=1e-5)


def test_moments_are_those_of_all_rows() -> None:
    values = np.random.default_rng(1).normal(3.0, 2.0, (1000, 4))
    moments = Moments((4,))
    for part in np.array_split(values, 13):
        moments.update(part)
    assert moments.mean == pytest.approx(values.mean(axis=0), abs=1e-5)
    assert moments.variance == pytest.approx(values.var(axis=0), rel=1e-3)


def test_many_environments_share_one_dictionary() -> None:
    made = learner()
    vec_env: BatchedVecEnv = made.vec_env
    vec_env.reset()
    infos = vec_env.step(np.zeros((4, 6), np.float32))[3]
    assert all(info is infos[0] for info in infos)
    for _ in range(74):
        _, _, over, infos = vec_env.step(np.zeros((4, 6), np.float32))
    assert over.all()
    assert all(info["TimeLimit.truncated"] for info in infos)
    assert infos[0]["terminal_observation"].shape == (30,)
    assert vec_env.done == 4


def test_the_last_observation_of_an_episode_is_that_of_its_end() -> None:
    """Environments that restart one step later show it; PPO judges by it what a cut episode was worth."""
    made = learner(normalize_observations=True)
    vec_env: BatchedVecEnv = made.vec_env
    vec_env.reset()
    later: Any = make_vector_environment(REACH, num_envs=4, seed=5, autoreset_mode="NextStep")
    later.reset()
    still = np.zeros((4, 6), np.float32)
    for _ in range(74):
        vec_env.step(still)
        later.step(still)
    moments = made.normaliser.arrays()
    fresh, _, over, infos = vec_env.step(still)
    final, *_ = later.step(still)
    assert over.all()
    mean, variance = (moments[f"normalise.observed.{name}"] for name in ("mean", "variance"))
    for index, info in enumerate(infos):
        expected = np.clip((final[index] - mean) / np.sqrt(variance + 1e-8), -10.0, 10.0)
        assert info["terminal_observation"] == pytest.approx(expected, abs=1e-4)
        assert not np.allclose(info["terminal_observation"], fresh[index], atol=0.1)


def test_checkpoints_are_whole_or_refused(tmp_path: Path) -> None:
    made = learner()
    rows(made, 1)
    files = checkpoint.as_files(*made.snapshot(), {"algorithm": "PPO"})
    folder = RunFolder.create(tmp_path, "run", {})
    paths = [folder.save(steps, files) for steps in (10, 20, 30, 40)]
    assert folder.checkpoints() == paths[1:]
    torn = paths[-1] / checkpoint.TRAINING
    torn.write_bytes(torn.read_bytes()[:-7])
    with pytest.raises(RunError, match=r"step_000000000040 cannot be used.*continues from step_000000000030"):
        checkpoint.read(paths[-1])
    (paths[-1] / "policy.safetensors").write_bytes(b"\x80\x04pickle")
    with pytest.raises(RunError, match="contains no policy of joshua-ppo-trainer"):
        Policy.load(paths[-1])
    with pytest.raises(RunError, match="the saved environments do not fit"):
        learner(num_envs=5).restore(*checkpoint.read(paths[-2]))
    with pytest.raises(RunError, match="weights do not fit the network of this file"):
        learner(hidden_sizes=[8]).restore(*checkpoint.read(paths[-2]))


TRAINING = """
general {{ mode: MODE_TRAINING name: "train" id: "train-ppo-{name}" }}
simulation {{ mode: OFFSCREEN model_path: "so_arm100/reach.xml" seed: 3 }}
ai {{ training {{
  environment: ENV_SIMULATION method: METHOD_RL simulator_backend: BACKEND_MUJOCO
  environment_id: "joshua/SoArm100Reach-v0"
  rl_config {{
    algorithm: "PPO" num_envs: 8 total_timesteps: {steps} learning_rate: 0.001 gamma: 0.9 batch_size: 64
    n_steps: 16 n_epochs: 4 checkpoint_steps: 128 output_folder: "{name}" {more}
  }}
}} }}
"""


@functools.cache
def own_domain() -> int:
    return _RESERVED.enter_context(reserved_domain())


def start(folder: Path, name: str, *, steps: int, more: str = "") -> subprocess.Popen[str]:
    path = folder / f"{name}{len(more)}.pbtxt"
    text = TRAINING.format(name=name, steps=steps, more=more)
    if "algorithm" in more:  # SAC, which refuses the fields of PPO
        text = text.replace('algorithm: "PPO" ', "").replace("n_steps: 16 n_epochs: 4 ", "")
    path.write_text(text)
    return subprocess.Popen(
        [sys.executable, "-m", "joshua.cli.main", "--config", str(path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
        env=os.environ | {"ROS_DOMAIN_ID": str(own_domain())},
    )


def test_a_run_that_diverges_keeps_the_batch(tmp_path: Path) -> None:
    path = tmp_path / "high.pbtxt"
    text = TRAINING.format(name="high", steps=4000, more="clip_range: 1 max_grad_norm: 1000 target_kl: 10")
    path.write_text(
        text.replace("learning_rate: 0.001", "learning_rate: 1").replace("n_epochs: 4", "n_epochs: 60")
    )
    node, context = prepared(path)
    node._learner._model.policy.value_net.weight.data.fill_(1e30)
    node.activate()
    assert node._ended.wait(100)
    with pytest.raises(RunError, match=r"is not a number after .*; the batch and the weights are in (.*)"):
        context.stop()
    (run,) = (tmp_path / "high").iterdir()
    kept = load_file(run / "diverged.safetensors")
    assert {"observations", "actions", "advantages", "weights.action_net.weight"} <= set(kept)
    node.cleanup()


def test_a_stop_before_the_first_step_leaves_no_checkpoint(tmp_path: Path) -> None:
    path = tmp_path / "none.pbtxt"
    path.write_text(TRAINING.format(name="none", steps=4000, more=""))
    node, context = prepared(path)
    context._stop.set()
    node.activate()
    assert node._ended.wait(100)
    context.stop()
    assert node.folder.checkpoints() == []
    node.cleanup()


def test_a_checkpoint_of_another_program_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run_folder, "ENDING_S", 0.0)
    path = tmp_path / "foreign.pbtxt"
    path.write_text(TRAINING.format(name="foreign", steps=128, more=""))
    node, context = prepared(path)
    node.activate()
    assert node._ended.wait(100)
    context.stop()
    (kept,) = node.folder.checkpoints()
    path.write_text(TRAINING.format(name="foreign", steps=256, more=f'resume_run: "{node.folder.path}"'))
    with pytest.raises(RunError, match=r"another process uses the run .*/foreign/SoArm100Reach"):
        prepared(path)
    node.cleanup()
    (kept / checkpoint.TRAINING).write_bytes((kept / "policy.safetensors").read_bytes())
    with pytest.raises(RunError, match=r"cannot be used: it is not from this trainer \(KeyError: 'normalise"):
        prepared(path)


def prepared(path: Path) -> tuple[Any, Any]:
    """The trainer's node of a file, configured, and its context."""
    result = examine(Request(str(path)))
    assert result.plan is not None, result.errors
    context = RecordingContext(result.plan.nodes[0])
    node = PpoTrainer(context)
    node.configure()
    return node, context


def curve(run: Path) -> list[dict[str, float]]:
    lines = (run / "metrics.jsonl").read_text().splitlines()
    found = [json.loads(line) for line in lines]
    return [{key: value for key, value in row.items() if not key.startswith("rate/")} for row in found]


def test_a_killed_run_goes_on_as_if_nothing_had_happened(tmp_path: Path) -> None:
    whole = start(tmp_path, "whole", steps=2000)
    said, _ = whole.communicate(timeout=250)
    assert whole.returncode == 0, said
    assert "2048 steps learned" in said
    killed = start(tmp_path, "killed", steps=2000)
    deadline = time.monotonic() + 200
    while time.monotonic() < deadline and len(list(tmp_path.glob("killed/*/checkpoints/step_*"))) < 2:
        time.sleep(0.02)
    os.killpg(killed.pid, signal.SIGKILL)
    killed.communicate()
    (run,) = (tmp_path / "killed").iterdir()
    resumed = start(tmp_path, "killed", steps=2000, more=f'resume_run: "killed/{run.name}"')
    said, _ = resumed.communicate(timeout=250)
    assert resumed.returncode == 0, said
    assert "continuing after" in said
    (other,) = (tmp_path / "whole").iterdir()
    assert curve(run) == curve(other)
    assert [path.name for path in (tmp_path / "killed").iterdir()] == [run.name]
    last = [max((path / "checkpoints").iterdir()) for path in (run, other)]
    for name in ("policy.safetensors", "training.safetensors", "state.json", "policy.json"):
        assert (last[0] / name).read_bytes() == (last[1] / name).read_bytes(), name
    kinds = {path.suffix for path in run.rglob("*") if path.is_file() and "tfevents" not in path.name}
    assert kinds == {".json", ".jsonl", ".log", ".pbtxt", ".safetensors", ".svg"}
    assert "INFO 2048 steps learned" in (run / "run.log").read_text().partition("INFO continuing")[2]
    (part,) = run.glob("config_*.pbtxt")
    assert f"# The configuration of this run after {part.stem[7:]} steps, with" in part.read_text()
    assert "# To continue the run from its last checkpoint, copy it to the folder of" in part.read_text()
    assert f'resume_run: "killed/{run.name}"' in part.read_text()
    assert "resume_run" not in (run / "config.pbtxt").read_text()
    assert list((run / "tensorboard").glob("*tfevents*"))
    facts = json.loads((run / "run.json").read_text())
    assert facts["settings"]["n_steps"] == 16
    assert {"joshua-ppo-trainer", "stable-baselines3", "torch"} <= set(facts["versions"])
    changed = start(tmp_path, "killed", steps=2000, more=f'resume_run: "killed/{run.name}" clip_range: 0.3')
    said, _ = changed.communicate(timeout=250)
    assert changed.returncode == 1
    assert "the run was started with clip_range 0.2, but the file says 0.3" in said

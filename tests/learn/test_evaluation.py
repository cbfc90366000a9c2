"""Evaluations of what was really trained: beside stable-baselines3's own, and with a policy of LeRobot."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import tiny_policies
import torch
from evaluation_files import write_evaluation
from joshua.api.models import Compute
from joshua.planner.pipeline import examine
from joshua.planner.request import Request
from joshua.testing.recording_context import RecordingContext
from joshua_evaluation.episodes import Arena
from joshua_evaluation.node import Evaluation
from joshua_evaluation.players import ModelPlayer, noise_of
from joshua_evaluation.plugins import model_offer
from joshua_mujoco_sim.envs import make_environment
from joshua_training.run_folder import RunFolder
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from test_ppo_trainer import REACH, learner

EPISODES, SEED = 30, 500


class Seeded(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Starts the episodes of consecutive seeds, which stable-baselines3 has no argument for."""

    def __init__(self, environment: Any) -> None:
        super().__init__(environment)
        self._seed = SEED
        self.successes: list[bool] = []

    def reset(self, **options: Any) -> Any:
        seed, self._seed = self._seed, self._seed + 1
        return self.env.reset(seed=seed)

    def step(self, action: Any) -> Any:
        answer = self.env.step(action)
        if answer[2] or answer[3]:
            self.successes.append(bool(answer[4]["is_success"]))
        return answer


def played(folder: Path, checkpoint: Path, more: str, episodes: int) -> Path:
    """Plays an evaluation to its end: its folder."""
    before = set((folder / "runs").glob("eval-*"))
    path = write_evaluation(folder, checkpoint, more, episodes=episodes, seed=f"seed: {SEED}")
    result = examine(Request(str(path)))
    assert result.plan is not None, result.errors
    context = RecordingContext(result.plan.nodes[0])
    node = Evaluation(context)
    node.configure()
    node.activate()
    assert node._ended.wait(200)
    context.stop()
    (made,) = set((folder / "runs").glob("eval-*")) - before
    return made


def evaluated(folder: Path, checkpoint: Path, more: str, episodes: int) -> dict[str, Any]:
    made = played(folder, checkpoint, f"videos: 0 {more}", episodes)
    content: dict[str, Any] = json.loads((made / "results.json").read_text())
    return content


def test_success_and_returns_are_those_of_stable_baselines3(tmp_path: Path) -> None:
    from joshua_ppo_trainer import checkpoint
    from joshua_ppo_trainer.node import _policy_facts

    made = learner(num_envs=64, total_timesteps=60_000, batch_size=512, n_steps=32, n_epochs=8)
    for _ in range(12):
        made.iterate()
    about = {
        **_policy_facts(type("Chosen", (), {"environment_id": REACH}), made._environment),
        "format": 1,
        "algorithm": "PPO",
        "activation": made._settings.activation,
        "normalisation": None,
    }
    run = RunFolder.create(tmp_path / "runs", "reach", {})
    run.save(made.steps, checkpoint.as_files(*made.snapshot(), about))
    content = evaluated(tmp_path, run.path, "", EPISODES)
    theirs = Seeded(make_environment(REACH, disable_env_checker=True))
    returns, lengths = evaluate_policy(
        made._model, Monitor(theirs), EPISODES, deterministic=True, return_episode_rewards=True
    )
    metrics = content["metrics"]
    rate = float(np.mean(theirs.successes[:EPISODES]))
    print(f"success {metrics['success_rate']['value']:.3f} here, {rate:.3f} of stable-baselines3")
    assert 0.05 < rate < 1.0
    # torch and NumPy round differently, which can move the end of an episode by a step
    assert metrics["success_rate"]["value"] == pytest.approx(rate, abs=1 / EPISODES)
    same = np.isclose(metrics["avg_return"]["episodes"], returns, atol=1e-3)
    assert same.mean() > 0.9
    assert np.isclose(metrics["episode_length"]["episodes"], lengths).mean() > 0.9


def test_a_policy_of_lerobot_is_judged_by_its_pictures(tmp_path: Path) -> None:
    tiny_policies.make_act(tmp_path / "act", radians=True)
    content = evaluated(tmp_path, tmp_path / "act", "compute { seed: 1 }", 2)
    assert content["complete"]
    assert content["metrics"]["episode_length"]["value"] == 75
    assert content["metrics"]["inference_latency"]["value"] > 0.1


@pytest.fixture
def diffusion(tmp_path: Path) -> Iterator[tuple[Any, ModelPlayer, Arena]]:
    """A tiny Diffusion policy by LeRobot, as a player, and an environment of it."""
    parts = tiny_policies.make_diffusion(tmp_path / "diffusion", radians=True)
    offer = model_offer("joshua.LeRobotPolicy", b"", str(tmp_path / "diffusion"), "", Compute())
    player = ModelPlayer(offer, noise_seed=3)
    arena = Arena("joshua_mujoco_sim.envs:make_vector_environment", REACH, "reach", **player.options)
    player.load(arena)
    yield parts, player, arena
    player.close()
    arena.close()


def test_a_policy_that_looks_back_sees_the_same_steps_as_with_lerobot(
    diffusion: tuple[Any, ModelPlayer, Arena],
) -> None:
    """Three chunks, the last two of which begin with the observation of the step before."""
    from lerobot.policies.utils import prepare_observation_for_inference

    (policy, before, after), player, arena = diffusion
    player.begin(SEED)
    policy.reset()
    observation = arena.reset(SEED)
    seen, actions = [], []
    for step in range(12):
        seen.append({key: np.array(value) for key, value in arena.values(observation).items()})
        actions.append(player.act(arena, observation, step)[0])
        observation = arena.step(actions[-1])[0]
    assert np.ptp([values["observation.state"] for values in seen], axis=0).max() > 0.01
    torch.manual_seed(noise_of(3, SEED))
    for values, action in zip(seen, actions, strict=True):
        known = {key: values[key] for key in policy.config.input_features}
        batch = before(prepare_observation_for_inference(known, torch.device("cpu"), ""))
        with torch.inference_mode():
            wanted = after(policy.select_action(batch)).numpy()[0]
        limits = arena.action_space
        np.testing.assert_allclose(action, np.clip(wanted, limits.low, limits.high), atol=1e-5, rtol=0)


def test_an_episode_has_noise_of_its_own_and_repeats(diffusion: tuple[Any, ModelPlayer, Arena]) -> None:
    _, player, arena = diffusion
    observation = arena.reset(SEED)
    actions: list[Any] = []
    for seed in (7, 8, 7):
        torch.manual_seed(len(actions))
        player.begin(seed)
        actions.append(player.act(arena, observation, 0)[0])
    np.testing.assert_array_equal(actions[0], actions[2])
    assert np.abs(actions[0] - actions[1]).max() > 1e-3


def test_the_video_of_a_policy_with_noise_shows_the_episode_that_was_measured(tmp_path: Path) -> None:
    tiny_policies.make_diffusion(tmp_path / "diffusion", radians=True)
    made = played(tmp_path, tmp_path / "diffusion", "compute { seed: 4 }", 1)
    page = (made / "report.html").read_text()
    assert page.count("<figcaption>") == 1
    assert "its replay differed" not in page
    assert json.loads((made / "run.json").read_text())["noise_seed"] == 4

"""Rollouts of PPO in several workers, here without a cluster: continued trainings, and workers made again."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import torch
from joshua.schema import config_pb2 as pb
from joshua_jobs.processes import Processes
from joshua_mujoco_sim.envs import make_vector_environment
from joshua_ppo_trainer import checkpoint
from joshua_ppo_trainer.learner import Learner, network_of
from joshua_ppo_trainer.settings import TrainerSettings
from joshua_ppo_trainer.spread import Collector, SpreadEnvironment, shares
from joshua_training.run_folder import RunError
from learner_behaviours import differ

REACH = "joshua/SoArm100Reach-v0"
MAKE = "joshua_mujoco_sim.envs:make_vector_environment"

torch.set_num_threads(1)


def learner(workers: int, warnings: list[str], num_envs: int = 5, **fields: Any) -> Learner:
    """A learner whose environments are in several workers; 0 for none."""
    small = {
        "total_timesteps": 1000,
        "learning_rate": 0.003,
        "gamma": 0.9,
        "batch_size": 20,
        "n_steps": 8,
        "n_epochs": 2,
        "normalize_observations": True,
        "normalize_rewards": True,
        "randomise": True,
    }
    config = pb.RLConfig(algorithm="PPO", num_envs=num_envs, **{**small, **fields})
    settings = TrainerSettings.from_block(pb.Training(environment=pb.ENV_SIMULATION, rl_config=config))
    settings = settings.suitable(REACH)
    options: dict[str, Any] = {"autoreset_mode": "SameStep", "randomise": True, "seed": 5}
    if not workers:
        return Learner(settings, make_vector_environment(REACH, num_envs=num_envs, **options), 5)
    parts = shares(
        num_envs,
        workers,
        5,
        make=MAKE,
        environment_id=REACH,
        reward_function="",
        randomise=True,
        network={**network_of(settings), "log_std_init": settings.initial_log_std},
        gamma=settings.gamma,
        observations=bool(settings.normalize_observations),
    )
    local = make_vector_environment(REACH, num_envs=1, **options)
    return Learner(settings, SpreadEnvironment(local, Processes(1), parts, warnings.append), 5)


def learned(made: Learner, iterations: int) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
    for _ in range(iterations):
        assert made.iterate() is not None
    return made.snapshot()


def test_as_many_workers_continue_bit_for_bit() -> None:
    # each learner in turn, because they share random generators
    whole = checkpointed(learned(learner(2, []), 12))
    assert whole[2]["episodes_done"] > 0
    for before in (0, 7):
        half = checkpointed(learned(learner(2, []), before))
        warnings: list[str] = []
        continued = learner(2, warnings)
        continued.restore(*half)
        after = checkpointed(learned(continued, 12 - before))
        assert not differ(after[0], whole[0])
        assert not differ(after[1], whole[1])
        assert after[2] == whole[2]
        assert warnings == []


def checkpointed(snapshot: tuple[Any, Any, Any]) -> tuple[Any, Any, Any]:
    """Through the bytes of a checkpoint."""
    from safetensors.numpy import load

    policy, training, state = snapshot
    return load(checkpoint.packed(policy)), load(checkpoint.packed(training)), state


def test_other_workers_continue_the_episodes_with_a_warning() -> None:
    half = checkpointed(learned(learner(2, []), 2))
    warnings: list[str] = []
    continued = learner(3, warnings)
    continued.restore(*half)
    assert warnings == [
        "3 workers continue what 2 began, so the result is not that of an uninterrupted run. For the same "
        "result, continue with 2 workers (cluster.workers: 2, and as many cores)"
    ]
    after = learned(continued, 1)
    elapsed = half[1]["environment.elapsed_steps"] + 8
    running = after[1]["environment.elapsed_steps"] == elapsed
    assert running.any()  # the others ended an episode
    assert after[2]["steps"] == 3 * 8 * 5


def test_checkpoints_from_elsewhere_are_refused_or_explained() -> None:
    half = checkpointed(learned(learner(2, []), 1))
    with pytest.raises(RunError, match="were in the workers of a cluster: continue with a cluster"):
        learner(0, []).restore(*half)
    with pytest.raises(RunError, match=r"the saved environments do not fit: .* continue with the num_envs"):
        learner(2, [], num_envs=6).restore(*half)
    warnings: list[str] = []
    learner(2, warnings).restore(*checkpointed(learned(learner(0, []), 1)))
    assert warnings == [
        "the run was not on a cluster before: its episodes start anew, and its result is not that of an "
        "uninterrupted run"
    ]


def test_a_collector_that_is_made_again_collects_the_same() -> None:
    made = learner(1, [])
    (share,) = made.vec_env.environment._crew._members
    sent = checkpoint.weights_of(made.policy), made.normaliser.arrays()
    before = share.collect(sent, 8, 1)
    expected = share.collect(sent, 8, 2)
    again = Collector(share._share).collect(sent, 8, 2, before.state)
    for name, values in vars(expected).items():
        if name in ("episodes", "state"):
            continue
        assert np.array_equal(values, getattr(again, name)), name
    assert again.episodes == expected.episodes
    assert not differ(again.state, expected.state)


def test_an_episode_that_is_cut_off_is_worth_its_last_observation() -> None:
    made = learner(1, [])
    (worker,) = made.vec_env.environment._crew._members
    sent = checkpoint.weights_of(made.policy), made.normaliser.arrays()
    part = worker.collect(sent, 75, 1)
    later: Any = make_vector_environment(REACH, num_envs=5, seed=5, autoreset_mode="NextStep", randomise=True)
    later.reset(seed=5)
    cut = np.zeros(5, bool)
    for actions in part.actions:
        final, _, _, cut, _ = later.step(np.clip(actions, -1.0, 1.0))
    assert cut.sum() >= 3
    shown = torch.as_tensor(made.normaliser.shown(final))
    values = made.policy.predict_values(shown).detach().numpy()[:, 0]
    assert part.bootstraps[-1][cut] == pytest.approx(made._settings.gamma * values[cut], rel=1e-4)
    assert (part.bootstraps[-1][~cut] == 0.0).all()
    assert (part.bootstraps[:-1] == 0.0).all()


def test_workers_collect_what_the_environments_here_collect() -> None:
    # moments of observations change with each step here, but with each rollout in the workers
    fields: dict[str, Any] = {"num_envs": 3, "n_steps": 80, "normalize_observations": False}
    spread = learner(1, [], **fields)
    spread._start()
    assert spread.vec_env.rollout(spread._model, 0, lambda: False)
    here = learner(0, [], **fields)
    here._start()
    here._model._last_obs, _ = here.vec_env.environment.reset(seed=5)  # as the worker starts
    torch.manual_seed(int(np.random.SeedSequence([5, 0, 0]).generate_state(1)[0]))
    model = here._model
    assert model.collect_rollouts(model.env, here._callback, model.rollout_buffer, n_rollout_steps=80)
    found, expected = spread._model.rollout_buffer, model.rollout_buffer
    assert expected.episode_starts[75].any()
    for name in ("observations", "actions", "episode_starts", "rewards", "values", "advantages", "returns"):
        assert getattr(found, name) == pytest.approx(getattr(expected, name), rel=1e-3, abs=1e-4), name
    assert list(spread.vec_env.episodes) == list(here.vec_env.episodes)

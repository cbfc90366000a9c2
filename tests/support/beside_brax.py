"""PPO on MuJoCo XLA, ours and brax's own, with equal updates of networks of the same layers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from joshua.schema import config_pb2 as pb
from joshua_mjx_trainer.environment import MjxEnvironments
from joshua_mjx_trainer.learner import Learner
from joshua_mjx_trainer.settings import MjxSettings
from joshua_mujoco_sim.envs import TASKS
from joshua_mujoco_sim.envs.single import make_task

N_STEPS, N_EPOCHS, MINI_BATCHES = 32, 8, 4


def make_learner(name: str, count: int, seed: int) -> Learner:
    """Our learner before its first iteration."""
    rl_config = pb.RLConfig(
        algorithm="PPO",
        num_envs=count,
        total_timesteps=10**9,
        learning_rate=0.001,
        gamma=0.95,
        n_steps=N_STEPS,
        n_epochs=N_EPOCHS,
        batch_size=count * N_STEPS // MINI_BATCHES,
        hidden_sizes=[64, 64],
    )
    block = pb.Training(environment=pb.ENV_SIMULATION, rl_config=rl_config)
    settings = MjxSettings.from_block(block).suitable(name)
    return Learner(settings, MjxEnvironments(make_task(TASKS[name], "", None, False)), seed)


def train_brax(
    many: MjxEnvironments,
    count: int,
    steps: int,
    evaluations: int,
    told: Callable[[int, Any], None],
    **options: Any,
) -> Callable[[Any], Any]:
    """Learns, calls ``told`` after each of the ``evaluations`` - 1 epochs, and returns the policy's means.

    brax restarts an episode where that environment's first one began, until the option
    ``num_resets_per_eval`` lets all start anew between two epochs.
    """
    if not hasattr(jax, "device_put_replicated"):  # gone from JAX 0.10, and brax 0.14 calls it
        jax.device_put_replicated = lambda tree, devices: jax.tree.map(
            lambda values: jnp.stack([values] * len(devices)), tree
        )
    from brax.envs.base import Env, State
    from brax.training.agents.ppo import networks, train

    class Environment(Env):  # type: ignore[misc,unused-ignore]
        """One environment; brax makes many of it."""

        observation_size = many.single_observation_space.shape[0]
        action_size = many.task.action_size
        backend = "mjx"

        def reset(self, rng: Any) -> Any:
            carry, seen = many.reset(rng[None])
            zero = jnp.float32(0.0)
            return State(jax.tree.map(lambda values: values[0], carry), seen[0], zero, zero, {}, {})

        def step(self, state: Any, action: Any) -> Any:
            carry = jax.tree.map(lambda values: values[None], state.pipeline_state)
            carry, done = many.advance(carry, action[None])
            return state.replace(
                pipeline_state=jax.tree.map(lambda values: values[0], carry),
                obs=done.final[0],
                reward=done.rewards[0],
                done=done.terminated[0].astype(jnp.float32),
                metrics={**state.metrics},
            )

    make_policy, weights, _ = train.train(
        Environment(),
        num_timesteps=steps,
        episode_length=many.task.max_steps,
        num_envs=count,
        learning_rate=0.001,
        discounting=0.95,
        unroll_length=N_STEPS,
        batch_size=count // MINI_BATCHES,
        num_minibatches=MINI_BATCHES,
        num_updates_per_batch=N_EPOCHS,
        num_evals=evaluations,
        run_evals=False,
        network_factory=lambda *sizes, **more: networks.make_ppo_networks(
            *sizes,
            policy_hidden_layer_sizes=(64, 64),
            value_hidden_layer_sizes=(64, 64),
            activation=jnp.tanh,
            **more,
        ),
        progress_fn=told,
        **options,
    )
    policy = make_policy(weights, deterministic=True)
    return lambda observations: policy(observations, jax.random.PRNGKey(0))[0]

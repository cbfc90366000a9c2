"""Environment steps a second of PPO on MuJoCo XLA: ours and brax's own, alternately, on the same model.

On a CPU: ``./test -s mjx -- bench``. On a GPU with 2,048 environments: ``./test -s mjx -- gpu``. By hand, if
``joshua-mjx-trainer[learn]``, brax and, for a GPU, ``jax[cuda12]`` are installed:
``python tests/plugins/mjx_trainer/bench_mjx.py --envs 2048``.
"""

from __future__ import annotations

import argparse
import os
import time
from typing import Any

os.environ.setdefault("NPROC", str(max(os.cpu_count() or 1, 8)))

import jax
import jax.numpy as jnp
import numpy as np
from joshua.schema import config_pb2 as pb
from joshua_mjx_trainer.environment import MjxEnvironments
from joshua_mjx_trainer.learner import Learner
from joshua_mjx_trainer.settings import MjxSettings
from joshua_mujoco_sim.envs import TASKS
from joshua_mujoco_sim.envs.single import make_task

N_STEPS, N_EPOCHS, MINI_BATCHES = 32, 8, 4


def ours(name: str, count: int) -> tuple[Learner, float]:
    """The learner after its first iteration, and the seconds that this took, compilation included."""
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
    begun_s = time.perf_counter()
    learner = Learner(settings, MjxEnvironments(make_task(TASKS[name], "", None, False)), seed=1)
    learner.iterate()
    return learner, time.perf_counter() - begun_s


def theirs(name: str, count: int, iterations: int) -> tuple[float, float]:
    """Steps a second of brax's PPO, and per second of the processor, after an epoch that compiles."""
    if not hasattr(jax, "device_put_replicated"):  # gone from JAX 0.10, and brax 0.14 calls it
        jax.device_put_replicated = lambda tree, devices: jax.tree.map(
            lambda values: jnp.stack([values] * len(devices)), tree
        )
    from brax.envs.base import Env, State
    from brax.training.agents.ppo import networks, train

    many = MjxEnvironments(make_task(TASKS[name], "", None, False))

    class Environment(Env):  # type: ignore[misc,unused-ignore]
        """One environment; brax makes many of it, and restarts episodes where they first began."""

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

    times: list[tuple[int, float, float]] = []
    train.train(
        Environment(),
        num_timesteps=2 * iterations * count * N_STEPS,
        episode_length=many.task.max_steps,
        num_envs=count,
        learning_rate=0.001,
        discounting=0.95,
        unroll_length=N_STEPS,
        batch_size=count // MINI_BATCHES,
        num_minibatches=MINI_BATCHES,
        num_updates_per_batch=N_EPOCHS,
        num_evals=3,
        run_evals=False,
        network_factory=lambda *sizes, **more: networks.make_ppo_networks(
            *sizes, policy_hidden_layer_sizes=(64, 64), value_hidden_layer_sizes=(64, 64), **more
        ),
        progress_fn=lambda steps, metrics: times.append((steps, *clocks())),
    )
    (before, wall_s, cpu_s), (after, wall_end_s, cpu_end_s) = times[-2:]
    return (after - before) / (wall_end_s - wall_s), (after - before) / (cpu_end_s - cpu_s)


def clocks() -> tuple[float, float]:
    """Time of the wall and of the processor."""
    return time.perf_counter(), time.process_time()


def run() -> None:
    """Measures in turns, and prints the figures and their ratio."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--task", default="joshua/SoArm100Reach-v0", choices=list(TASKS))
    parser.add_argument("--envs", type=int, default=0, help="0: 64 on a CPU, 2,048 on an accelerator")
    parser.add_argument("--iterations", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--without-brax", action="store_true")
    parser.add_argument("--learn", type=int, default=0, help="learn for so many steps, and print the success")
    asked = parser.parse_args()
    device = jax.devices()[0]
    count = asked.envs or (64 if device.platform == "cpu" else 2048)
    print(
        f"{device.device_kind}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}: {count} x {asked.task}"
    )
    learner, first_s = ours(asked.task, count)
    print(f"first iteration, which compiles: {first_s:.1f} s", flush=True)
    begun_s = time.perf_counter()
    while learner.steps < asked.learn:
        row = learner.iterate() or {}
        print(
            f"{learner.steps} steps, {time.perf_counter() - begun_s:.0f} s: success "
            f"{row.get('episode/success_rate', 0.0):.2f}, {row['rate/steps_per_s']:.0f} steps/s",
            flush=True,
        )
    ratios = []
    for _ in range(asked.rounds):
        before, (wall_s, cpu_s) = learner.steps, clocks()
        for _ in range(asked.iterations):
            learner.iterate()
        taken, (wall_end_s, cpu_end_s) = learner.steps - before, clocks()
        rate, per_cpu = taken / (wall_end_s - wall_s), taken / (cpu_end_s - cpu_s)
        print(f"ours {rate:.0f} environment steps/s, {per_cpu:.0f} per second of CPU", flush=True)
        if not asked.without_brax:
            other, other_per_cpu = theirs(asked.task, count, asked.iterations)
            ratios.append(rate / other)
            print(
                f"brax {other:.0f}, {other_per_cpu:.0f} per second of CPU; ratio {ratios[-1]:.2f}, "
                f"of CPU {per_cpu / other_per_cpu:.2f}",
                flush=True,
            )
    if ratios:
        print(f"median ratio {np.median(ratios):.2f}, least {min(ratios):.2f}   target >= 0.9")
    peak = (device.memory_stats() or {}).get("peak_bytes_in_use")
    if peak:
        print(f"peak memory {peak / 1e9:.2f} GB")


if __name__ == "__main__":
    run()

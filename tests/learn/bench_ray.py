"""Costs of messages on a Ray cluster of this machine, and work a second from none or 1 to N workers.

``learning`` measures evaluations and rollouts only. Modules of ``tests/support`` must be on the path.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import torch
from joshua.schema import config_pb2 as pb
from joshua_evaluation.bouts import Bout, played
from joshua_evaluation.settings import Candidate
from joshua_jobs.choice import opened
from joshua_jobs.executor import Executor
from joshua_jobs.processes import Processes
from joshua_mujoco_sim.envs import make_vector_environment
from joshua_ppo_trainer.learner import Learner, network_of
from joshua_ppo_trainer.settings import TrainerSettings
from joshua_ppo_trainer.spread import SpreadEnvironment, shares
from trained_policies import write_policy

MAKE = "joshua_mujoco_sim.envs:make_vector_environment"
TASK = "joshua/SoArm100Reach-v0"
EPISODES, ROLLOUTS = 150, 9


def nothing(_: int) -> None:
    """Do nothing."""


def asleep(_: int) -> None:
    """Wait, as for a simulator elsewhere."""
    time.sleep(0.05)


def busy(_: int) -> float:
    """Compute for about 50 ms."""
    return float(sum(np.sin(np.arange(20_000.0)).sum() for _ in range(200)))


class Echo:
    """An object that gives back what it gets."""

    def back(self, value: Any) -> Any:
        """Return a value."""
        return value


def rate(executor: Executor, function: Callable[[int], Any], count: int) -> float:
    """Return jobs per second."""
    list(executor.in_order(function, range(4 * executor.workers)))
    began_s = time.perf_counter()
    list(executor.in_order(function, range(count)))
    return count / (time.perf_counter() - began_s)


def evaluating(executor: Executor | None, policy: Path) -> float:
    """Return episodes per second of an evaluation."""
    bout = Bout(Candidate(field="", given=str(policy), path=str(policy)), MAKE, TASK, "")
    with executor or Processes(1) as used:
        list(used.in_order(played, [(bout, seed) for seed in range(4 * used.workers)]))
        began_s = time.perf_counter()
        list(used.in_order(played, [(bout, seed) for seed in range(EPISODES)]))
        return EPISODES / (time.perf_counter() - began_s)


def collecting(executor: Executor | None) -> tuple[float, float]:
    """Return environment steps per second of the rollouts of PPO with 64 environments, and with updates."""
    config = pb.RLConfig(algorithm="PPO", num_envs=64, total_timesteps=10**9, batch_size=512)
    block = pb.Training(environment=pb.ENV_SIMULATION, rl_config=config)
    settings = TrainerSettings.from_block(block).suitable(TASK)
    options: dict[str, Any] = {"autoreset_mode": "SameStep", "seed": 5}
    if executor is None:
        environment: Any = make_vector_environment(TASK, num_envs=64, **options)
    else:
        parts = shares(
            64,
            executor.workers,
            5,
            make=MAKE,
            environment_id=TASK,
            reward_function="",
            randomise=False,
            network={**network_of(settings), "log_std_init": settings.initial_log_std},
            gamma=settings.gamma,
            observations=bool(settings.normalize_observations),
        )
        local = make_vector_environment(TASK, num_envs=1, **options)
        environment = SpreadEnvironment(local, executor, parts, print)
    learner = Learner(settings, environment, 5)
    learner.iterate()
    whole_s, collect_s = [], []
    collect = learner._collect

    def timed() -> bool:
        began_s = time.perf_counter()
        done = collect()
        collect_s.append(time.perf_counter() - began_s)
        return done

    learner._collect = timed  # type: ignore[method-assign]
    steps = 64 * (settings.n_steps or 1)
    for _ in range(ROLLOUTS):
        began_s = time.perf_counter()
        learner.iterate()
        whole_s.append(time.perf_counter() - began_s)
    environment.close()
    return steps / median(collect_s), steps / median(whole_s)


def learning() -> None:
    """Measure evaluations and rollouts with none, one and more workers."""
    torch.set_num_threads(1)
    counts = (None, *range(1, len(os.sched_getaffinity(0)) + 1))

    def on(count: int | None) -> Executor | None:
        return None if count is None else opened(("ray", "local"), count)

    with TemporaryDirectory() as folder:
        policy = write_policy(Path(folder) / "policy", environment=TASK)
        base: list[float] = []
        for count in counts:
            rates = [evaluating(on(count), policy), *collecting(on(count))]
            base = base or rates
            shown = [
                f"{name} {rate:.1f}/s ({rate / first:.2f})"
                for name, rate, first in zip(WORK, rates, base, strict=True)
            ]
            load = os.getloadavg()[0]
            print(f"{TASK}, {count or 'no'} workers: {', '.join(shown)}, load {load:.1f}", flush=True)


def main() -> None:
    """Run all measurements."""
    cores = len(os.sched_getaffinity(0))
    print(f"load {os.getloadavg()[0]:.1f}, {cores} cores", flush=True)
    if "learning" in sys.argv[1:]:
        learning()
        return
    for workers in (None, *range(1, cores + 1)):
        with opened(("ray", "local"), workers) as executor:
            if workers is None:
                crew = executor.crew(Echo, [()])
                for size in (0, 100_000, 1_000_000, 10_000_000):
                    value, count = np.zeros(size, np.uint8), 200 if size < 1_000_000 else 20
                    crew.each("back", [(value,)])
                    began_s = time.perf_counter()
                    for _ in range(count):
                        crew.each("back", [(value,)])
                    took_ms = 1e3 * (time.perf_counter() - began_s) / count
                    print(f"call there and back, {size} bytes: {took_ms:.2f} ms", flush=True)
                crew.close()
            rates = [f"{name} {rate(executor, job, n):.1f}/s" for name, job, n in JOBS]
            print(f"{workers or 'all'} workers: {', '.join(rates)}", flush=True)
    learning()


WORK = ("episodes", "steps of rollouts", "steps with updates")
JOBS = (("empty", nothing, 500), ("sleep of 50 ms", asleep, 80), ("computing", busy, 80))

if __name__ == "__main__":
    main()

"""Environment steps a second of PPO on MuJoCo XLA: ours and brax's own, alternately, on the same model.

On a CPU: ``./test -s mjx -- bench``. On a GPU with 2,048 environments: ``./test -s mjx -- gpu``. By hand, if
``joshua-mjx-trainer[learn]``, brax and, for a GPU, ``jax[cuda12]`` are installed:
``python tests/plugins/mjx_trainer/bench_mjx.py --envs 2048``.

Both learn in this process, in turns: ours iterates between two epochs of brax. Both take the same number of
steps, epochs and mini-batches of the same size, with networks of the same layers, and end episodes alike.
Compilation is not counted. On a machine that does other things as well, compare the steps per second of CPU.
Exit code 1 if ours makes fewer steps a second than the target.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable
from typing import Any, NamedTuple

os.environ.setdefault("NPROC", str(max(os.cpu_count() or 1, 8)))

import jax
import numpy as np
from beside_brax import N_STEPS, make_learner, train_brax
from joshua_mjx_trainer.environment import MjxEnvironments
from joshua_mjx_trainer.learner import Learner
from joshua_mujoco_sim.envs import TASKS
from joshua_mujoco_sim.envs.single import make_task

#: Least environment steps a second, as a multiple of brax's.
TARGET = 0.9


class Rate(NamedTuple):
    """Environment steps a second, by the clock and by the processor's time."""

    wall: float
    cpu: float


class Stopwatch:
    """Measures rates from its making on."""

    def __init__(self) -> None:
        self._begun = time.perf_counter(), time.process_time()

    def rate(self, steps: int) -> Rate:
        """Steps a second."""
        wall_s, cpu_s = self._begun
        return Rate(steps / (time.perf_counter() - wall_s), steps / (time.process_time() - cpu_s))

    @property
    def s(self) -> float:
        """Seconds since."""
        return time.perf_counter() - self._begun[0]


def ours(name: str, count: int) -> tuple[Learner, float]:
    """The learner after its first iteration, and the seconds that this took, compilation included."""
    watch = Stopwatch()
    learner = make_learner(name, count, seed=1)
    learner.iterate()
    return learner, watch.s


def theirs(
    name: str, count: int, iterations: int, rounds: int, told: Callable[[int, Rate, float], None]
) -> None:
    """Learns by brax's PPO, and calls ``told`` after each epoch, with its number, rate and seconds.

    The first two compile: the second gets arrays that already lie on the device.
    """
    epochs, watch = 0, Stopwatch()

    def after_epoch(_: int, __: Any) -> None:
        nonlocal epochs, watch
        told(epochs, watch.rate(iterations * count * N_STEPS), watch.s)
        epochs, watch = epochs + 1, Stopwatch()

    many = MjxEnvironments(make_task(TASKS[name], "", None, False))
    train_brax(many, count, (rounds + 2) * iterations * count * N_STEPS, rounds + 3, after_epoch)


def run() -> int:
    """Measures in turns, and prints the figures and their ratio. Returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--task", default="joshua/SoArm100Reach-v0", choices=list(TASKS))
    parser.add_argument("--envs", type=int, default=0, help="0: 16 on a CPU, 2,048 on an accelerator")
    parser.add_argument("--iterations", type=int, default=0, help="of a round; 0: 1 on a CPU, else 4")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--without-brax", action="store_true")
    parser.add_argument("--learn", type=int, default=0, help="learn for so many steps, and print the success")
    asked = parser.parse_args()
    device = jax.devices()[0]
    on_cpu = device.platform == "cpu"
    count, iterations = asked.envs or (16 if on_cpu else 2048), asked.iterations or (1 if on_cpu else 4)
    print(
        f"{device.device_kind}, {len(os.sched_getaffinity(0))} cores, load {os.getloadavg()[0]:.1f}: "
        f"{count} x {asked.task}, {iterations * count * N_STEPS} steps a round"
    )
    learner, first_s = ours(asked.task, count)
    print(f"ours: the first iteration, which compiles, took {first_s:.0f} s", flush=True)
    watch = Stopwatch()
    while learner.steps < asked.learn:
        row = learner.iterate() or {}
        print(
            f"{learner.steps} steps, {watch.s:.0f} s: success "
            f"{row.get('episode/success_rate', 0.0):.2f}, {row['rate/steps_per_s']:.0f} steps/s",
            flush=True,
        )
    ratios: list[tuple[float, float]] = []

    def own_round() -> Rate:
        before, watch = learner.steps, Stopwatch()
        for _ in range(iterations):
            learner.iterate()
        rate = watch.rate(learner.steps - before)
        print(f"ours {rate.wall:.0f} environment steps/s, {rate.cpu:.0f} per second of CPU", flush=True)
        return rate

    def compare(epoch: int, other: Rate, took_s: float) -> None:
        if epoch < 2:
            print(f"brax: epoch {epoch}, which compiles, took {took_s:.0f} s", flush=True)
            return
        rate = own_round()
        ratios.append((rate.wall / other.wall, rate.cpu / other.cpu))
        print(
            f"brax {other.wall:.0f}, {other.cpu:.0f} per second of CPU; ratio {ratios[-1][0]:.2f}, "
            f"of CPU {ratios[-1][1]:.2f}",
            flush=True,
        )

    if asked.without_brax:
        for _ in range(asked.rounds):
            own_round()
    else:
        theirs(asked.task, count, iterations, asked.rounds, compare)
    peak = (device.memory_stats() or {}).get("peak_bytes_in_use")
    if peak:
        print(f"peak memory {peak / 1e9:.2f} GB")
    if not ratios:
        return 0
    wall, cpu = np.median(ratios, axis=0)
    verdict = "met" if wall >= TARGET else "missed"
    print(f"{verdict}: median ratio of the steps a second {wall:.2f}, of CPU {cpu:.2f}, target >= {TARGET}")
    return int(wall < TARGET)


if __name__ == "__main__":
    sys.exit(run())

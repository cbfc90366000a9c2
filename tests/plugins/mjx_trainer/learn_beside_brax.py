"""Success of PPO on MuJoCo XLA after the same number of steps: ours and brax's own, on the same model.

``./test -s mjx -- success``. Both take the same number of steps, epochs and mini-batches of the same size,
with networks of the same layers, and normalise observations. brax learns twice: with episodes that restart
where they first began, as it does by itself, and with an option of it, new starts after every tenth of the
training. The means of the policies then play the same fresh episodes.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable
from typing import Any

os.environ.setdefault("NPROC", str(max(os.cpu_count() or 1, 8)))

import jax
import jax.numpy as jnp
import numpy as np
from beside_brax import N_STEPS, make_learner, train_brax
from joshua_mjx_trainer import network
from joshua_mjx_trainer.environment import MjxEnvironments
from joshua_mujoco_sim.envs import TASKS
from joshua_mujoco_sim.envs.single import make_task

PARTS, EPISODES = 10, 200


def success(many: MjxEnvironments, act: Callable[[Any], Any], seed: int = 1000) -> float:
    """Share of fresh episodes that succeed."""
    keys = jax.vmap(lambda index: jax.random.fold_in(jax.random.PRNGKey(seed), index))(jnp.arange(EPISODES))

    def step(carry: Any, seen: Any) -> Any:
        carry, done = many.advance(carry, act(seen))
        return carry, done.final, done.terminated, done.success

    step = jax.jit(step)
    carry, seen = jax.jit(many.reset)(keys)
    over, won = np.zeros(EPISODES, bool), np.zeros(EPISODES, bool)
    for _ in range(many.task.max_steps):
        carry, seen, ended, succeeded = step(carry, seen)
        won |= np.asarray(succeeded) & ~over
        over |= np.asarray(ended)
    return float(won.mean())


def report(what: str, share: float, began_s: float) -> None:
    """Prints a share and how long it took."""
    print(f"{what} {share:.3f}, {time.perf_counter() - began_s:.0f} s", flush=True)


def main() -> None:
    """Learns in turn, and prints the shares."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--task", default="joshua/SoArm100Reach-v0", choices=list(TASKS))
    parser.add_argument("--envs", type=int, default=16)
    parser.add_argument("--steps", type=int, default=61_440)
    parser.add_argument("--seeds", type=int, default=2)
    asked = parser.parse_args()
    many = MjxEnvironments(make_task(TASKS[asked.task], "", None, False))
    size = asked.envs * N_STEPS
    steps = -(-asked.steps // (PARTS * size)) * PARTS * size
    for seed in range(1, asked.seeds + 1):
        began_s = time.perf_counter()
        learner = make_learner(asked.task, asked.envs, seed)
        while learner.steps < steps:
            learner.iterate()

        def mean(seen: Any, learner: Any = learner) -> Any:
            tree = learner.tree
            shown = learner._shown(seen, tree["normalise"]["observed"])
            return network.mean_action(tree["weights"], shown, learner._settings)

        share = success(many, mean)
        print(
            f"seed {seed}, {learner.steps} steps: ours {share:.3f}, {time.perf_counter() - began_s:.0f} s",
            flush=True,
        )
        for resets in (0, 1):
            began_s = time.perf_counter()
            policy = train_brax(
                many,
                asked.envs,
                steps,
                PARTS + 1,
                lambda *_: None,
                normalize_observations=True,
                num_resets_per_eval=resets,
                seed=seed,
            )
            share = success(many, policy)
            starts = "new starts after each tenth" if resets else "its own restarts"
            print(
                f"seed {seed}: brax with {starts} {share:.3f}, {time.perf_counter() - began_s:.0f} s",
                flush=True,
            )


if __name__ == "__main__":
    main()

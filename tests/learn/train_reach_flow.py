"""Trains the flow policy of ``tests/support/reach_flow.py`` and writes its weights; the seed stands below.

A demonstrator brings the grip past a bar, above or below by chance, and on to the goal. Its commands are
disturbed, so that the policy learns the way back. Flow matching then learns the velocity from noise to a
chunk of commands (Lipman et al. 2023). Five to eight minutes on one core.
Run: python tests/learn/train_reach_flow.py [EPISODES [STEPS]]
"""

from __future__ import annotations

import sys
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).resolve().parents[1] / "support"))

import numpy as np
import torch
from reach_flow import RATE_HZ, STEPS, TIME_FEATURES, WEIGHTS, Scene, cosines, time_features

SEED, EPISODES, TRAINING_STEPS, BATCH, WIDTH = 7, 500, 7000, 512, 192
SPEED_M_S, SETTLED_S = 0.1, 0.8
#: How far the way leaves the straight line, and how much its commands are disturbed.
HEIGHTS_M, NOISE_RAD = (0.045, 0.075), 0.01
DECAY = 0.999


def demonstration(scene: Scene, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """What is seen at each step, shape (T, 9), and the commands, shape (T + a chunk, 6)."""
    scene.reset(seed)
    draw = np.random.default_rng([seed, 1])
    height = draw.choice((-1, 1)) * draw.uniform(*HEIGHTS_M)
    begin = draw.uniform(0.0, 0.3) if draw.uniform() < 0.3 else 0.0
    start, way = scene.start_m, scene.goal_m - scene.start_m
    length = np.hypot(np.linalg.norm(way), 1.5 * abs(height))
    count = round(length / SPEED_M_S * RATE_HZ)
    shares = np.clip(np.arange(begin * count, count + (SETTLED_S + 2) * RATE_HZ + STEPS) / count, 0, 1)
    places = start + shares[:, None] * way
    places[:, 2] += height * np.sin(np.pi * shares)
    joints, goals = scene.joints, []
    for place in places:
        joints[:5] = scene.kinematics.solve(joints[:5], place, rounds=4)
        goals.append(scene.held(joints))
    seen, disturbance = [], np.zeros(6)
    for goal in goals[:-STEPS]:
        seen.append(np.append(scene.joints, scene.goal_m))
        disturbance = 0.9 * disturbance + NOISE_RAD * draw.normal(size=6) * (draw.uniform() < 0.5)
        scene.move(goal + disturbance)
    return np.array(seen), np.array(goals)


def data(episodes: int) -> tuple[np.ndarray, np.ndarray]:
    """What is seen, (M, 9), and the chunks relative to the joints, (M, STEPS, 6)."""
    scene, seen, chunks = Scene(), [], []
    for number in range(episodes):
        states, goals = demonstration(scene, 10_000 + number)
        for step, state in enumerate(states):
            seen.append(state)
            chunks.append(goals[step : step + STEPS] - state[:6])
    return np.array(seen), np.array(chunks)


def train(seen: np.ndarray, chunks: np.ndarray, steps: int) -> dict[str, np.ndarray]:
    """The arrays of the policy."""
    torch.manual_seed(SEED)
    mean, spread = seen.mean(axis=0), seen.std(axis=0) + 1e-3
    scale = chunks.std(axis=(0, 1)) + 1e-3
    entries = torch.tensor((seen - mean) / spread, dtype=torch.float32)
    parts = cosines() @ (chunks / scale)
    unit = np.sqrt((parts**2).mean())
    targets = torch.tensor((parts / unit).reshape(len(parts), -1), dtype=torch.float32)
    sizes = [targets.shape[1] + entries.shape[1] + TIME_FEATURES, WIDTH, WIDTH, WIDTH, targets.shape[1]]
    layers: list[torch.nn.Module] = []
    for before, after in pairwise(sizes):
        layers += [torch.nn.Linear(before, after), torch.nn.SiLU()]
    network = torch.nn.Sequential(*layers[:-1])
    averaged = [parameter.detach().clone() for parameter in network.parameters()]
    optimizer = torch.optim.AdamW(network.parameters(), lr=1e-3, weight_decay=1e-4)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, steps, eta_min=1e-5)
    losses, began_s = [], time.monotonic()
    for number in range(steps):
        rows = torch.randint(len(entries), (BATCH,))
        clean, noise, at = targets[rows], torch.randn(BATCH, targets.shape[1]), torch.rand(BATCH)
        noisy = at[:, None] * clean + (1 - at[:, None]) * noise
        features = torch.tensor(time_features(at.numpy()), dtype=torch.float32)
        velocity = network(torch.cat([noisy, entries[rows], features], dim=1))
        loss = ((velocity - (clean - noise)) ** 2).mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        schedule.step()
        with torch.no_grad():
            for kept, parameter in zip(averaged, network.parameters(), strict=True):
                kept.lerp_(parameter, 1 - DECAY)
        losses.append(loss.item())
        if (number + 1) % 1000 == 0:
            seconds = time.monotonic() - began_s
            print(f"{number + 1:6} steps  loss {np.mean(losses[-1000:]):.4f}  {seconds:.0f} s")
    arrays = {"mean": mean, "spread": spread, "scale": scale, "unit": unit}
    for number, (weight, bias) in enumerate(zip(averaged[::2], averaged[1::2], strict=True)):
        arrays[f"w{number}"], arrays[f"b{number}"] = weight.numpy().T, bias.numpy()
    return arrays


def main(episodes: int = EPISODES, steps: int = TRAINING_STEPS) -> None:
    """Trains and writes the weights in half precision."""
    torch.set_num_threads(1)
    began_s = time.monotonic()
    seen, chunks = data(episodes)
    print(f"{len(seen)} steps of {episodes} demonstrations after {time.monotonic() - began_s:.0f} s")
    arrays = train(seen, chunks, steps)
    kept: dict[str, Any] = {
        name: np.asarray(value, np.float16 if name[0] in "wb" else np.float32)
        for name, value in arrays.items()
    }
    np.savez_compressed(WEIGHTS, **kept)
    print(f"{WEIGHTS.name}: {WEIGHTS.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))

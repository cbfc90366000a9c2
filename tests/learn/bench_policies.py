"""Prints how long a chunk of ACT takes: LeRobot's policy alone, as a model here, and exported to ONNX.

The three take turns in one process, on one thread each, so that what else the machine does spoils all alike.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import tiny_policies
import torch
from joshua.api import JointSpace, Observation
from joshua_lerobot.policy import LeRobotModel
from joshua_lerobot.settings import LeRobotSettings
from joshua_onnx.exporting import export
from joshua_onnx.model import OnnxModel
from joshua_onnx.settings import OnnxSettings
from lerobot.policies.utils import prepare_observation_for_inference

SIZES = {
    "tiny ACT, two pictures of 96 x 96": (96, 96),
    "the same network, two pictures of 320 x 240": (240, 320),
}
JOINTS = JointSpace(tuple("abcdef"), np.full(6, -2.0), np.full(6, 2.0))


def main(rounds: int = 20) -> None:
    """Measures each size."""
    for name, (height, width) in SIZES.items():
        with tempfile.TemporaryDirectory() as scratch:
            times, difference = measured(Path(scratch), height, width, rounds)
        base = statistics.median(times["LeRobot alone"])
        print(f"{name}: largest difference of the export {difference:.1e} rad")
        for row, taken in times.items():
            p50 = statistics.median(taken)
            print(
                f"  {row:18} p50 {1e3 * p50:7.1f} ms   least {1e3 * min(taken):7.1f} ms"
                f"   {p50 / base:.2f} of LeRobot's"
            )


def measured(folder: Path, height: int, width: int, rounds: int) -> tuple[dict[str, list[float]], float]:
    """Seconds of each chunk, by who made it, and how far the export is off."""
    policy, before, after = tiny_policies.make_act(folder / "act", height=height, width=width)
    list(export(folder / "act", folder / "onnx"))
    torch.set_num_threads(1)
    models: list[Any] = []
    ways_to_load: tuple[tuple[Any, Any, Path], ...] = (
        (LeRobotModel, LeRobotSettings, folder / "act"),
        (OnnxModel, OnnxSettings, folder / "onnx"),
    )
    for kind, settings, place in ways_to_load:
        model = kind(settings(weights=str(place), rate_hz=30.0), JOINTS)
        model.load()
        model.reset()
        models.append(model)
    draw = np.random.default_rng(0)
    values: dict[str, Any] = {
        f"observation.images.{name}": draw.integers(0, 255, (height, width, 3), np.uint8)
        for name in ("top", "wrist")
    }
    values["observation.state"] = draw.uniform(-1, 1, 6).astype(np.float32)
    seen = Observation(1, values, {})

    def alone() -> Any:
        with torch.inference_mode():
            batch = prepare_observation_for_inference(dict(values), torch.device("cpu"))
            return after(policy.predict_action_chunk(before(batch)))

    ways: dict[str, Callable[[], Any]] = {
        "LeRobot alone": alone,
        "as a model here": lambda: models[0].act(seen),
        "exported to ONNX": lambda: models[1].act(seen),
    }
    times: dict[str, list[float]] = {name: [] for name in ways}
    for number in range(rounds + 2):
        for name, chunk in ways.items():
            began = time.perf_counter()
            chunk()
            if number >= 2:
                times[name].append(time.perf_counter() - began)
    return times, float(np.abs(models[0].act(seen) - models[1].act(seen)).max())


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))

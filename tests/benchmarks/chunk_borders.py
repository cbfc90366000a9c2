"""What a flow policy trained here does under two strategies when its chunks arrive 0.3 s late.

The policy drives the simulated SO-ARM100 past a bar to a goal, by the loop of the node in stepped time
(tests/support/reach_flow.py; tests/learn/train_reach_flow.py trained it). Each start is the same for all.
Run: python tests/benchmarks/chunk_borders.py [STARTS [DELAY_S [FIRST_SEED]]]
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1] / "support"))

import numpy as np
from reach_flow import Run, Scene, drive

STRATEGIES = ("REPLACE_ON_ARRIVAL", "REAL_TIME_CHUNKING")


def main(starts: int = 50, delay_s: float = 0.3, first: int = 0) -> None:
    """Prints a row for each strategy."""
    scene = Scene()
    print(f"{starts} starts, chunks {delay_s:g} s late; means, and the largest change of speed of each way")
    print("strategy               jump at a border   change of speed   reached   passed   time")
    for strategy in STRATEGIES:
        ways = [
            drive(strategy, seed=seed, delay_s=delay_s, scene=scene) for seed in range(first, first + starts)
        ]
        reached, passed = (
            100 * np.mean([getattr(way, name) for way in ways]) for name in ("reached", "passed")
        )
        print(
            f"{strategy:<20}{mean(ways, 'border_mean_rad'):>15.4f} rad"
            f"{mean(ways, 'border_rad_s'):>12.2f} rad/s"
            f"{reached:>9.0f} %{passed:>7.0f} %{np.mean([way.time_s for way in ways]):>7.2f} s"
        )


def mean(ways: list[Run], figure: str) -> float:
    """Mean of a figure of the loop."""
    return float(np.mean([getattr(way.figures, figure) for way in ways]))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:2]), *map(float, sys.argv[2:3]), *map(int, sys.argv[3:4]))

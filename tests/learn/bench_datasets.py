"""Prints how fast data sets are written and read: ours beside LeRobot's, the same frames in the same run."""

from __future__ import annotations

import contextlib
import os
import random
import tempfile
import time
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from joshua.features import DatasetLayout, Feature, FeatureSet, Frame
from joshua_dataset.checking import check
from joshua_dataset.reader import Dataset
from joshua_dataset.recomputing import recomputed
from joshua_dataset.writer import LeRobotWriter
from lerobot.datasets.lerobot_dataset import LeRobotDataset

JOINTS = tuple(f"joint_{number}.pos" for number in range(6))
NUMBERS = ("observation.state", "action")
CAMERAS = ("observation.images.top", "observation.images.wrist")
FPS, HEIGHT, WIDTH, FRAMES = 30, 480, 640, 150
ROUNDS = 3


def scene() -> list[Any]:
    """Pictures with edges, gradients and noise that move, as a camera's do."""
    source = np.random.default_rng(0)
    blocks = source.integers(0, 128, (HEIGHT // 16, WIDTH // 16, 3), dtype=np.uint8)
    base = blocks.repeat(16, 0).repeat(16, 1)
    noise = source.integers(0, 6, (HEIGHT, WIDTH, 3), dtype=np.uint8)
    return [np.roll(base, 3 * i, axis=1) + np.roll(noise, i, axis=0) for i in range(FRAMES)]


def ours(folder: Path, pictures: list[Any], codec: str = "h264") -> None:
    numbers = [Feature.joints(key, JOINTS, unit="lerobot") for key in NUMBERS]
    features = FeatureSet([*numbers, *(Feature.picture(key, HEIGHT, WIDTH) for key in CAMERAS)])
    layout = DatasetLayout(folder, "so101_follower", FPS, features, codec=codec)
    with contextlib.closing(LeRobotWriter(layout)) as writer:
        writer.open()
        for number, picture in enumerate(pictures):
            values: dict[str, Any] = dict.fromkeys(NUMBERS, np.full(6, number, np.float32))
            writer.add_frame(Frame(number, values | dict.fromkeys(CAMERAS, picture)))
        writer.end_episode("stack")


def theirs(folder: Path, pictures: list[Any], codec: str = "") -> None:
    """LeRobot's own data set; without a codec its pictures are PNG files."""
    described: dict[str, Any] = {
        key: {"dtype": "float32", "shape": (6,), "names": list(JOINTS)} for key in NUMBERS
    }
    kind, names = "video" if codec else "image", ["height", "width", "channels"]
    described |= {key: {"dtype": kind, "shape": (HEIGHT, WIDTH, 3), "names": names} for key in CAMERAS}
    chosen = {"vcodec": codec} if codec else {}
    made = LeRobotDataset.create("me/set", FPS, described, root=folder, use_videos=bool(codec), **chosen)
    for number, picture in enumerate(pictures):
        values: dict[str, Any] = dict.fromkeys(NUMBERS, np.full(6, number, np.float32))
        made.add_frame(values | dict.fromkeys(CAMERAS, picture) | {"task": "stack"})
    made.save_episode()
    made.finalize()


def rate(work: Callable[[], object], count: int) -> float:
    began = time.perf_counter()
    work()
    return count / (time.perf_counter() - began)


def paired(one: Callable[[], float], other: Callable[[], float]) -> tuple[float, float]:
    """The best rates of both in alternate rounds: whatever else the machine does only slows them down."""
    rounds = [(one(), other()) for _ in range(ROUNDS)]
    return max(first for first, _ in rounds), max(second for _, second in rounds)


def main() -> None:
    torch.set_num_threads(1)
    pictures = scene()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        print(f"load {os.getloadavg()[0]:.1f}")
        print(f"writing {FRAMES} frames of 6 joints and two {WIDTH} x {HEIGHT} cameras, frames/s")
        mine = rate(lambda: ours(folder / "ours h264", pictures), FRAMES)
        rates = {
            "H.264": rate(lambda: theirs(folder / "theirs h264", pictures, "h264"), FRAMES),
            "AV1": rate(lambda: theirs(folder / "theirs av1", pictures, "libsvtav1"), FRAMES),
            "PNG": rate(lambda: theirs(folder / "png", pictures), FRAMES),
        }
        ours(folder / "ours av1", pictures, "av1")
        print(f"  ours (H.264) {mine:.0f}")
        for label, figure in rates.items():
            print(f"  LeRobot ({label}) {figure:.0f}: ours is {mine / figure:.1f} times as fast")

        order = random.Random(0).choices(range(FRAMES), k=60)
        for what, indices in (("random frames", order), ("an epoch", range(FRAMES))):
            print(f"LeRobot reads {what}, frames/s")
            for codec in ("h264", "av1"):
                rounds = [
                    alternate_reads(folder / f"ours {codec}", folder / f"theirs {codec}", indices)
                    for _ in range(ROUNDS)
                ]
                mine, own = (max(rates) for rates in zip(*rounds, strict=True))
                print(f"  {codec}: ours {mine:.0f}   its own {own:.0f}   ratio {mine / own:.2f}")
        print("an epoch of LeRobot's data set, frames/s")
        for codec in ("h264", "av1"):
            there = folder / f"theirs {codec}"
            reader, lerobot = paired(
                partial(rate, partial(decode_all, there), FRAMES), partial(read_rate, there, range(FRAMES))
            )
            print(
                f"  {codec}: our reader {reader:.0f}   LeRobot {lerobot:.0f}   ratio {reader / lerobot:.2f}"
            )
        print("statistics of LeRobot's data set (h264), one process, frames/s")
        compare_statistics(folder / "theirs h264")


def compare_statistics(folder: Path) -> None:
    from lerobot.datasets.v30.augment_dataset_quantile_stats import compute_quantile_stats_for_dataset

    loaded = LeRobotDataset("me/set", root=folder)
    lerobot = rate(lambda: compute_quantile_stats_for_dataset(loaded), FRAMES)
    for label, work in (
        ("joshua dataset stats", lambda: recomputed(folder, workers=1)),
        ("joshua dataset check", lambda: list(check(folder, workers=1))),
    ):
        figure = rate(work, FRAMES)
        print(f"  {label} {figure:.0f}   LeRobot {lerobot:.0f}   ratio {figure / lerobot:.1f}")


def read_rate(folder: Path, order: Iterable[int]) -> float:
    loaded = LeRobotDataset("me/set", root=folder)
    indices = list(order)

    def read() -> None:
        for number in indices:
            loaded[number]

    return rate(read, len(indices))


def alternate_reads(one: Path, other: Path, order: Iterable[int]) -> tuple[float, float]:
    """Rates of LeRobot's reads of two data sets, each frame of one beside the same frame of the other."""
    sets = [LeRobotDataset("me/set", root=folder) for folder in (one, other)]
    spent_s, indices = [0.0, 0.0], list(order)
    for count, number in enumerate(indices):
        for side in (0, 1) if count % 2 else (1, 0):
            began = time.perf_counter()
            sets[side][number]
            spent_s[side] += time.perf_counter() - began
    return len(indices) / spent_s[0], len(indices) / spent_s[1]


def decode_all(folder: Path) -> None:
    """Every value and picture of a data set, by our reader."""
    reader = Dataset.read(folder)
    for episode in reader.episode_list():
        reader.columns(episode)
        for key in CAMERAS:
            assert sum(1 for _ in reader.decoded(episode, key)) == episode.length


if __name__ == "__main__":
    main()

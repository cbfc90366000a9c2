"""Prints how fast data sets are written and read: ours beside LeRobot's, the same frames in the same run."""

from __future__ import annotations

import contextlib
import random
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from joshua.features import DatasetLayout, Feature, FeatureSet, Frame
from joshua_dataset.reader import Dataset
from joshua_dataset.writer import LeRobotWriter
from lerobot_here import lerobot_dataset

JOINTS = tuple(f"joint_{number}.pos" for number in range(6))
NUMBERS = ("observation.state", "action")
CAMERAS = ("observation.images.top", "observation.images.wrist")
FPS, HEIGHT, WIDTH, FRAMES = 30, 480, 640, 150


def scene() -> list[Any]:
    """Pictures with edges, gradients and noise that move, as a camera's do."""
    source = np.random.default_rng(0)
    blocks = source.integers(0, 128, (HEIGHT // 16, WIDTH // 16, 3), dtype=np.uint8)
    base = blocks.repeat(16, 0).repeat(16, 1)
    noise = source.integers(0, 6, (HEIGHT, WIDTH, 3), dtype=np.uint8)
    return [np.roll(base, 3 * i, axis=1) + np.roll(noise, i, axis=0) for i in range(FRAMES)]


def ours(folder: Path, pictures: list[Any]) -> None:
    numbers = [Feature.joints(key, JOINTS, unit="lerobot") for key in NUMBERS]
    features = FeatureSet([*numbers, *(Feature.picture(key, HEIGHT, WIDTH) for key in CAMERAS)])
    layout = DatasetLayout(folder, "so101_follower", FPS, features)
    with contextlib.closing(LeRobotWriter(layout)) as writer:
        writer.open()
        for number, picture in enumerate(pictures):
            values: dict[str, Any] = dict.fromkeys(NUMBERS, np.full(6, number, np.float32))
            writer.add_frame(Frame(number, values | dict.fromkeys(CAMERAS, picture)))
        writer.end_episode("stack")


def theirs(folder: Path, pictures: list[Any], *, video: bool = True) -> None:
    described: dict[str, Any] = {
        key: {"dtype": "float32", "shape": (6,), "names": list(JOINTS)} for key in NUMBERS
    }
    kind, names = "video" if video else "image", ["height", "width", "channels"]
    described |= {key: {"dtype": kind, "shape": (HEIGHT, WIDTH, 3), "names": names} for key in CAMERAS}
    made = lerobot_dataset().create("me/set", FPS, described, root=folder, use_videos=video)
    for number, picture in enumerate(pictures):
        values: dict[str, Any] = dict.fromkeys(NUMBERS, np.full(6, number, np.float32))
        made.add_frame(values | dict.fromkeys(CAMERAS, picture) | {"task": "stack"})
    made.save_episode()
    made.finalize()


def rate(work: Callable[[], None], count: int) -> float:
    began = time.perf_counter()
    work()
    return count / (time.perf_counter() - began)


def main() -> None:
    pictures = scene()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        print(f"writing {FRAMES} frames of 6 joints and two {WIDTH} x {HEIGHT} cameras, frames/s")
        mine = rate(lambda: ours(folder / "ours", pictures), FRAMES)
        video = rate(lambda: theirs(folder / "theirs", pictures), FRAMES)
        files = rate(lambda: theirs(folder / "png", pictures, video=False), FRAMES)
        print(f"  ours (H.264) {mine:.0f}   LeRobot (AV1) {video:.0f}   LeRobot (PNG) {files:.0f}")
        print(f"  ratio {mine / video:.1f} and {mine / files:.1f}")

        order = random.Random(0).choices(range(FRAMES), k=60)
        print("LeRobot reads random frames, frames/s")
        read = {label: read_rate(folder / label, order) for label in ("ours", "theirs")}
        ratio = read["ours"] / read["theirs"]
        print(f"  ours {read['ours']:.0f}   its own {read['theirs']:.0f}   ratio {ratio:.2f}")
        sweep = rate(lambda: decode_all(folder / "ours"), FRAMES)
        print(f"our reader, one camera after the other: {sweep:.0f} frames/s")


def read_rate(folder: Path, order: list[int]) -> float:
    loaded = lerobot_dataset()("me/set", root=folder)

    def read() -> None:
        for number in order:
            loaded[number]

    return rate(read, len(order))


def decode_all(folder: Path) -> None:
    reader = Dataset.read(folder)
    for episode in reader.episode_list():
        for key in CAMERAS:
            assert sum(1 for _ in reader.decoded(episode, key)) == episode.length


if __name__ == "__main__":
    main()

"""Records episodes at 50 frames a second until it is killed; says what it has done, a line for each frame."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from joshua.features import DatasetLayout, Feature, FeatureSet, Frame
from joshua_dataset.writer import LeRobotWriter

FPS = 50
TOP, SIDE = "observation.images.top", "observation.images.side"
FEATURES = FeatureSet(
    [
        Feature.joints("observation.state", ("a", "b")),
        Feature.joints("action", ("a", "b")),
        Feature.picture(TOP, 64, 64),
        Feature.picture(SIDE, 64, 64),
    ]
)


def layout(folder: Path) -> DatasetLayout:
    return DatasetLayout(folder, "arm", FPS, FEATURES, resume=True)


def record(folder: Path, length: int, say: Callable[[str], object]) -> NoReturn:
    writer = LeRobotWriter(layout(folder))
    writer.task = "wave"
    writer.open()
    say("open")
    began, number = time.monotonic(), 0
    while True:
        picture = np.full((64, 64, 3), number % 250, np.uint8)
        values: dict[str, Any] = {
            "observation.state": [number, 0],
            "action": [number, 1],
            TOP: picture,
            SIDE: picture,
        }
        writer.add_frame(Frame(number, values))
        number += 1
        if writer.open_frames == length:
            writer.end_episode("wave")
        say(f"{writer.episodes} {writer.open_frames}")
        time.sleep(max(0.0, began + number / FPS - time.monotonic()))


def main() -> None:
    def say(text: str) -> None:
        sys.stdout.write(f"{text}\n")
        sys.stdout.flush()

    record(Path(sys.argv[1]), int(sys.argv[2]), say)


if __name__ == "__main__":
    main()

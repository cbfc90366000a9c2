"""Small data sets: two joints and one camera, ten frames a second."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from joshua.features import DatasetLayout, Feature, FeatureSet, Frame
from joshua_dataset.writer import DatasetWriter, LeRobotWriter

JOINTS = ("pan", "lift")
TOP = "observation.images.top"


def layout(folder: Path, width: int = 32, **changes: Any) -> DatasetLayout:
    return DatasetLayout(
        **changes,
        folder=folder,
        robot_type="arm",
        fps=10,
        features=FeatureSet(
            [
                Feature.joints("observation.state", JOINTS),
                Feature.joints("action", JOINTS),
                Feature.picture(TOP, 24, width),
            ]
        ),
    )


def frame(number: int, stamp_ns: int = 0, changes: Mapping[str, Any] | None = None) -> Frame:
    picture = np.full((24, 32, 3), 20 * number, np.uint8)
    values: dict[str, Any] = {
        "observation.state": [number, -number],
        "action": [number + 0.5, 0.0],
        TOP: picture,
    }
    return Frame(stamp_ns, values | dict(changes or {}))


@contextlib.contextmanager
def writing(folder: Path, *, lengths: tuple[int, ...] = (3, 2)) -> Iterator[LeRobotWriter]:
    with contextlib.closing(LeRobotWriter(layout(folder))) as writer:
        writer.open()
        for length in lengths:
            add_episode(writer, "wave" if length == 3 else "point", length)
        yield writer


def write(folder: Path, *, lengths: tuple[int, ...] = (3, 2)) -> None:
    with writing(folder, lengths=lengths):
        pass


def add_episode(writer: DatasetWriter, task: str, length: int = 3) -> None:
    for number in range(length):
        writer.add_frame(frame(number, 1000 + number))
    writer.end_episode(task)

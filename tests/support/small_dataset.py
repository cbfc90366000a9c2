"""Small data sets: two joints and one camera, ten frames a second."""

from __future__ import annotations

import contextlib
import json
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from joshua.features import DatasetLayout, Feature, FeatureSet, Frame
from joshua_dataset.metadata import INFO
from joshua_dataset.reader import Dataset
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


def as_v21(folder: Path) -> None:
    """Turns a data set into LeRobot's layout v2.1."""
    found = Dataset.read(folder)
    rows = list(found.episode_list())
    info = json.loads((folder / INFO).read_text())
    info |= {
        "codebase_version": "v2.1",
        "data_path": "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet",
        "video_path": "videos/chunk-{episode_chunk:03d}/{video_key}/episode_{episode_index:06d}.mp4",
    }
    del info["joshua"]
    for row in rows:
        row.table.rename(row.table.with_name(f"episode_{row.index:06d}.parquet"))
        target = folder / f"videos/chunk-000/{TOP}/episode_{row.index:06d}.mp4"
        target.parent.mkdir(parents=True, exist_ok=True)
        row.pictures[TOP].path.rename(target)
    shutil.rmtree(folder / "meta/episodes")
    (folder / "meta/tasks.parquet").unlink()
    lines = {
        "episodes": [{"episode_index": r.index, "tasks": list(r.tasks), "length": r.length} for r in rows],
        "tasks": [{"task_index": i, "task": task} for i, task in enumerate(found.tasks)],
        "episodes_stats": [{"episode_index": r.index, "stats": dict(r.statistics)} for r in rows],
    }
    for name, records in lines.items():
        text = "".join(json.dumps(record) + "\n" for record in records)
        (folder / f"meta/{name}.jsonl").write_text(text)
    (folder / INFO).write_text(json.dumps(info))

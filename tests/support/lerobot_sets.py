"""Small data sets in LeRobot's layouts v3.0 and v2.1.

Four episodes at 10 Hz with two joints and one camera. In the layout v3.0 they share one table and one video,
in v2.1 each has its own.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import av
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from joshua_dataset import metadata
from joshua_dataset.recomputing import recompute
from small_dataset import TOP, layout

FPS = 10
LENGTHS = (6, 5, 7, 4)
TASKS = ("wave", "point")

V30, V21 = "v3.0", "v2.1"

#: The episode that tests change.
VICTIM = 1


def make(folder: Path, version: str) -> None:
    """Write a data set without damage."""
    tables = [rows_of(number) for number in range(len(LENGTHS))]
    info = metadata.info(layout(folder), "lerobot", episodes=4, frames=sum(LENGTHS), tasks=2)
    del info["joshua"], info["features"]["stamp_ns"]
    (folder / "meta").mkdir(parents=True)
    if version == V30:
        write_table(folder / rows_path(V30), pa.concat_tables(tables))
        encode(folder / video_path(V30), sum(LENGTHS))
        write_table(
            folder / episodes_path(), pa.Table.from_pylist([described(number) for number in range(4)])
        )
        write_table(folder / metadata.TASKS, metadata.tasks_table(TASKS))
    else:
        info |= {
            "codebase_version": V21,
            "data_path": "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet",
            "video_path": "videos/chunk-{episode_chunk:03d}/{video_key}/episode_{episode_index:06d}.mp4",
            "total_videos": 4,
            "total_chunks": 1,
        }
        for number, table in enumerate(tables):
            write_table(folder / rows_path(V21, number), table)
            encode(folder / video_path(V21, number), LENGTHS[number], first=sum(LENGTHS[:number]))
        rows = [
            {"episode_index": number, "tasks": [TASKS[number % 2]], "length": length}
            for number, length in enumerate(LENGTHS)
        ]
        lines(folder, "episodes", rows)
        lines(folder, "tasks", [{"task_index": index, "task": text} for index, text in enumerate(TASKS)])
    (folder / metadata.INFO).write_text(json.dumps(info))
    recompute(folder, workers=1)


def rows_of(number: int) -> pa.Table:
    length, first = LENGTHS[number], sum(LENGTHS[:number])
    frames = np.arange(length)
    values = np.stack([np.sin((first + frames) / 3), np.cos((first + frames) / 3)], axis=1).astype(np.float32)
    kind = pa.list_(pa.float32(), 2)
    return pa.table(
        {
            "observation.state": pa.FixedSizeListArray.from_arrays(pa.array(values.ravel()), type=kind),
            "action": pa.FixedSizeListArray.from_arrays(pa.array((values + 0.05).ravel()), type=kind),
            "timestamp": pa.array((frames / FPS).astype(np.float32)),
            "frame_index": pa.array(frames),
            "episode_index": pa.array(np.full(length, number)),
            "index": pa.array(first + frames),
            "task_index": pa.array(np.full(length, number % 2)),
        }
    )


def described(number: int) -> dict[str, Any]:
    first, length = sum(LENGTHS[:number]), LENGTHS[number]
    return {
        "episode_index": number,
        "tasks": [TASKS[number % 2]],
        "length": length,
        "data/chunk_index": 0,
        "data/file_index": 0,
        "dataset_from_index": first,
        "dataset_to_index": first + length,
        f"videos/{TOP}/chunk_index": 0,
        f"videos/{TOP}/file_index": 0,
        f"videos/{TOP}/from_timestamp": first / FPS,
        f"videos/{TOP}/to_timestamp": (first + length) / FPS,
        "meta/episodes/chunk_index": 0,
        "meta/episodes/file_index": 0,
    }


def encode(path: Path, count: int, *, first: int = 0, rate: int = FPS, side: int = 0) -> None:
    """Write a video, all pictures of which can be told apart."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with av.open(str(path), "w", format="mp4", options={"movflags": "faststart"}) as target:
        stream: Any = target.add_stream("libx264", rate=rate, options={"g": "2", "bf": "0"})
        stream.height, stream.width, stream.pix_fmt = side or 24, side or 32, "yuv420p"
        for number in range(first, first + count):
            picture = np.random.default_rng(number).integers(
                0, 256, (stream.height, stream.width, 3), np.uint8
            )
            for packet in stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")):
                target.mux(packet)
        for packet in stream.encode():
            target.mux(packet)


def rows_path(version: str, number: int = VICTIM) -> str:
    if version == V30:
        return "data/chunk-000/file-000.parquet"
    return f"data/chunk-000/episode_{number:06d}.parquet"


def video_path(version: str, number: int = VICTIM) -> str:
    if version == V30:
        return f"videos/{TOP}/chunk-000/file-000.mp4"
    return f"videos/chunk-000/{TOP}/episode_{number:06d}.mp4"


def episodes_path() -> str:
    return "meta/episodes/chunk-000/file-000.parquet"


def lines(folder: Path, name: str, rows: list[dict[str, Any]]) -> None:
    text = "".join(json.dumps(row) + "\n" for row in rows)
    (folder / f"meta/{name}.jsonl").write_text(text)


def read_lines(folder: Path, name: str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (folder / f"meta/{name}.jsonl").read_text().splitlines()]


def write_table(path: Path, table: pa.Table) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(table, path)

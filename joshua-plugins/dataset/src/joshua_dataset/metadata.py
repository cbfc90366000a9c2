"""The files under ``meta/`` of a LeRobot v3 data set, and the schema that its tables carry."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import pyarrow as pa
from joshua.features import DatasetLayout

from joshua_dataset.staging import Staging
from joshua_dataset.statistics import Statistics, as_json, merged
from joshua_dataset.video import CODEC, PIXEL_FORMAT

VERSION = "v3.0"

#: Files in one folder.
CHUNK_SIZE = 1000

DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
VIDEO_PATH = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"

#: Column of the real acquisition stamps, ns.
STAMP = "stamp_ns"

#: Columns that every data set has.
INDEX_COLUMNS = {
    "timestamp": "float32",
    STAMP: "int64",
    "frame_index": "int64",
    "episode_index": "int64",
    "index": "int64",
    "task_index": "int64",
}


def data_schema(layout: DatasetLayout) -> pa.Schema:
    """Schema of the tables of frames; its metadata tell the ``datasets`` library the features."""
    numbers = layout.features.numbers
    fields = [
        pa.field(feature.key, pa.list_(pa.from_numpy_dtype(feature.dtype), feature.shape[0]))
        for feature in numbers
    ]
    described: dict[str, Any] = {
        feature.key: {
            "feature": {"dtype": feature.dtype, "_type": "Value"},
            "length": feature.shape[0],
            "_type": "List",
        }
        for feature in numbers
    }
    for name, kind in INDEX_COLUMNS.items():
        fields.append(pa.field(name, pa.float32() if kind == "float32" else pa.int64()))
        described[name] = {"dtype": kind, "_type": "Value"}
    return pa.schema(fields, metadata={"huggingface": json.dumps({"info": {"features": described}})})


def write_metadata(
    staging: Staging,
    layout: DatasetLayout,
    episodes: Sequence[Mapping[str, Any]],
    statistics: Sequence[Mapping[str, Statistics]],
    tasks: Sequence[str],
) -> None:
    """Writes everything under ``meta/``; what stands there stays until the staging is committed.

    Args:
        staging: takes the files; layout: of the data set; tasks: in the order of their index.
        episodes: rows of the table of episodes; statistics: of each of them, by feature.
    """
    meta = layout.folder / "meta"
    staging.table(meta / "tasks.parquet", _tasks_table(tasks))
    staging.table(meta / "episodes" / "chunk-000" / "file-000.parquet", pa.Table.from_pylist(list(episodes)))
    together = {key: as_json(merged([part[key] for part in statistics])) for key in statistics[0]}
    staging.json(meta / "stats.json", together)
    staging.json(meta / "info.json", _info(layout, episodes, tasks))


def _info(
    layout: DatasetLayout, episodes: Sequence[Mapping[str, Any]], tasks: Sequence[str]
) -> dict[str, Any]:
    features = layout.features.as_lerobot()
    for feature in layout.features.pictures:
        height, width, _ = feature.shape
        features[feature.key]["info"] = {
            "video.height": height,
            "video.width": width,
            "video.codec": CODEC,
            "video.pix_fmt": PIXEL_FORMAT,
            "video.is_depth_map": False,
            "video.fps": layout.fps,
            "video.channels": 3,
            "has_audio": False,
        }
    for name, kind in INDEX_COLUMNS.items():
        features[name] = {"dtype": kind, "shape": [1], "names": None}
    return {
        "codebase_version": VERSION,
        "robot_type": layout.robot_type,
        "total_episodes": len(episodes),
        "total_frames": sum(row["length"] for row in episodes),
        "total_tasks": len(tasks),
        "chunks_size": CHUNK_SIZE,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": layout.fps,
        "splits": {"train": f"0:{len(episodes)}"},
        "data_path": DATA_PATH,
        "video_path": VIDEO_PATH if layout.features.pictures else None,
        "features": features,
    }


def _tasks_table(tasks: Sequence[str]) -> pa.Table:
    """Tasks by their text, which LeRobot reads as the index of a pandas table."""
    index = "__index_level_0__"
    described = {
        "index_columns": [index],
        "column_indexes": [
            {
                "name": None,
                "field_name": None,
                "pandas_type": "unicode",
                "numpy_type": "object",
                "metadata": {"encoding": "UTF-8"},
            }
        ],
        "columns": [
            {
                "name": "task_index",
                "field_name": "task_index",
                "pandas_type": "int64",
                "numpy_type": "int64",
                "metadata": None,
            },
            {
                "name": None,
                "field_name": index,
                "pandas_type": "unicode",
                "numpy_type": "object",
                "metadata": None,
            },
        ],
        "creator": {"library": "pyarrow", "version": pa.__version__},
        "pandas_version": "2.2.0",
    }
    table = pa.table({"task_index": pa.array(range(len(tasks)), pa.int64()), index: list(tasks)})
    return table.replace_schema_metadata({"pandas": json.dumps(described)})

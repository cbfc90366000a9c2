"""The files under ``meta/`` of a data set, and the schema that its tables carry."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
from joshua.features import DatasetLayout, EpisodeError

from joshua_dataset.pictures import ENCODERS, PIXEL_FORMAT

VERSION = "v3.0"

#: Number of files in one folder.
CHUNK_SIZE = 1000

#: Suffix of the tables by format; ``lerobot`` has LeRobot's layout, the others the same columns.
SUFFIXES = {"lerobot": ".parquet", "parquet": ".parquet", "csv": ".csv", "jsonl": ".jsonl", "mcap": ""}

DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}"
VIDEO_PATH = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
PICTURES_PATH = "images/{video_key}/chunk-{chunk_index:03d}/episode-{file_index:03d}"
EPISODES_PATH = "meta/episodes/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"

#: Column of the acquisition time of each value, ns since the epoch, in the order of the features.
ACQUISITION = "acquisition_ns"

INFO = Path("meta") / "info.json"
STATS = Path("meta") / "stats.json"
TASKS = Path("meta") / "tasks.parquet"

#: Statistics by episode in LeRobot's layout v2.1; v3.0 keeps them in the table of episodes.
EPISODES_STATS = Path("meta") / "episodes_stats.jsonl"

#: Column of the frames' acquisition stamps, ns since the epoch.
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

#: Picture storage of a data set of ROS 2 messages.
MESSAGES = "messages"

#: Entry of ``info.json`` for data that LeRobot's layout has no place for.
OURS = "joshua"


#: What a data set consists of beside files.
FOLDERS = ("data", "meta", "videos", "images")

#: Names of the files of a data set, in the layouts v2 and v3, and of the folders of its episodes.
_OWN = re.compile(
    r"data/chunk-\d+/(file|episode)[-_]\d+(\.parquet|\.csv|\.jsonl)?"
    r"|videos/.+/(file|episode)[-_]\d+\.mp4"
    r"|images/.+/episode-\d+"
    r"|meta/(info|stats)\.json"
    r"|meta/(tasks|episodes|episodes_stats)\.(parquet|jsonl)"
    r"|meta/episodes/chunk-\d+/file-\d+\.parquet"
    r"|schema\.json"
)


def is_own(name: str) -> bool:
    """Return whether a file or folder belongs to a data set, by its path in it with slashes."""
    return _OWN.fullmatch(name) is not None


def place(episode: int) -> dict[str, int]:
    """Return the chunk and file of an episode."""
    return {"chunk_index": episode // CHUNK_SIZE, "file_index": episode % CHUNK_SIZE}


def check_layout(layout: DatasetLayout, table_format: str, *, whole: bool = True) -> None:
    """Refuse features, codecs and pictures that a data set cannot contain. Raises EpisodeError.

    Args:
        whole: refuse features of unknown shape, too.
    """
    for feature in layout.features.values():
        if 0 in feature.shape and not whole:
            continue
        if 0 in feature.shape or not (feature.is_picture or len(feature.shape) == 1):
            raise EpisodeError(f"{feature.key} has the shape {feature.shape}, which no column can hold")
        odd = feature.is_picture and (feature.shape[0] % 2 or feature.shape[1] % 2)
        if odd and layout.pictures == "video":
            height, width, _ = feature.shape
            raise EpisodeError(f"{feature.key} is {width} x {height}: a video needs an even width and height")
    if layout.codec not in ENCODERS:
        raise EpisodeError(f"no encoder for the codec {layout.codec!r}; allowed: {', '.join(ENCODERS)}")
    if table_format == "lerobot" and layout.pictures != "video":
        raise EpisodeError("LeRobot's layout keeps pictures as videos: leave pictures out")


def data_schema(layout: DatasetLayout, *, lists_of_one: bool = False) -> pa.Schema:
    """Return the schema of frame tables; its metadata describe the features to the ``datasets`` library.

    LeRobot reads a feature of the shape (1,) only from a column of numbers.

    Args:
        lists_of_one: store such a feature as lists of length 1, as the tables that are appended to do.
    """
    fields = []
    described: dict[str, Any] = {}
    for feature in layout.features.numbers:
        kind, value = pa.from_numpy_dtype(feature.dtype), {"dtype": feature.dtype, "_type": "Value"}
        if feature.shape == (1,) and not lists_of_one:
            fields.append(pa.field(feature.key, kind))
            described[feature.key] = value
        else:
            fields.append(pa.field(feature.key, pa.list_(kind, feature.shape[0])))
            described[feature.key] = {"feature": value, "length": feature.shape[0], "_type": "List"}
    for name, kind in INDEX_COLUMNS.items():
        fields.append(pa.field(name, pa.float32() if kind == "float32" else pa.int64()))
        described[name] = {"dtype": kind, "_type": "Value"}
    return pa.schema(fields, metadata={"huggingface": json.dumps({"info": {"features": described}})})


def is_list(kind: pa.DataType) -> bool:
    """Return whether a column contains lists."""
    kinds = (pa.types.is_fixed_size_list, pa.types.is_list, pa.types.is_large_list)
    return any(matches(kind) for matches in kinds)


def column_of(values: npt.NDArray[Any], kind: pa.DataType) -> pa.Array:
    """Return numbers, (N,) or (N, D), as a column of numbers or of lists of a fixed length."""
    if is_list(kind):
        return pa.FixedSizeListArray.from_arrays(pa.array(values.reshape(-1)), kind.list_size)
    return pa.array(values.reshape(-1), kind)


def array_of(column: pa.ChunkedArray) -> npt.NDArray[Any]:
    """Return a column as an array: (N,) for numbers, (N, D) for lists, objects for lists that differ."""
    values = column.combine_chunks()
    if not is_list(values.type):
        return np.asarray(values.to_numpy(zero_copy_only=False))
    flat = values.flatten().to_numpy(zero_copy_only=False)
    if len(values) and len(flat) % len(values) == 0 and not values.null_count:
        return np.asarray(flat).reshape(len(values), -1)
    return np.asarray(values.to_pylist(), dtype=object)


def flat_table(columns: Mapping[str, npt.NDArray[Any]], layout: DatasetLayout) -> pa.Table:
    """Return a table with one column for each number of a feature, named ``action.shoulder_pan``."""
    flat: dict[str, Any] = {}
    for name, values in columns.items():
        if name in layout.features:
            rows = values.reshape(len(values), -1)
            names = layout.features[name].names or tuple(map(str, range(rows.shape[1])))
            flat |= {f"{name}.{part}": rows[:, i] for i, part in enumerate(names)}
        else:
            flat[name] = values
    return pa.table(flat)


def info(
    layout: DatasetLayout, table_format: str, *, episodes: int, frames: int, tasks: int
) -> dict[str, Any]:
    """Return the content of ``meta/info.json``."""
    features = layout.features.as_lerobot()
    for feature in layout.features.pictures:
        height, width, _ = feature.shape
        features[feature.key]["info"] = {
            "video.height": height,
            "video.width": width,
            "video.codec": layout.codec,
            "video.pix_fmt": PIXEL_FORMAT,
            "video.is_depth_map": False,
            "video.fps": layout.fps,
            "video.channels": 3,
            "has_audio": False,
        }
        if layout.pictures != "video":
            features[feature.key] |= {"dtype": "image", "info": {"file_format": layout.pictures}}
    for name, kind in INDEX_COLUMNS.items():
        features[name] = {"dtype": kind, "shape": [1], "names": None}
    pictures_path = VIDEO_PATH if layout.pictures == "video" else PICTURES_PATH
    return {
        "codebase_version": VERSION,
        "robot_type": layout.robot_type,
        "total_episodes": episodes,
        "total_frames": frames,
        "total_tasks": tasks,
        "chunks_size": CHUNK_SIZE,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": layout.fps,
        "splits": {"train": f"0:{episodes}"},
        "data_path": DATA_PATH + SUFFIXES[table_format],
        "video_path": pictures_path if layout.features.pictures else None,
        "features": features,
        OURS: {
            "format": table_format,
            "pictures": layout.pictures,
            "codec": layout.codec,
            "identity": dict(layout.identity),
            "counters": list(layout.counters),
        },
    }


def tasks_table(tasks: Sequence[str]) -> pa.Table:
    """Return the tasks by their text, which LeRobot reads as the index of a pandas table."""
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


def table_schema(layout: DatasetLayout, table_format: str) -> dict[str, Any]:
    """Return the content of ``schema.json``, which describes the columns of a plain table."""
    columns: dict[str, Any] = {}
    for feature in layout.features.numbers:
        described = {"dtype": feature.dtype, "unit": feature.unit or None}
        if table_format == "csv":
            names = feature.names or tuple(map(str, range(feature.shape[0])))
            columns |= {f"{feature.key}.{name}": described for name in names}
        else:
            columns[feature.key] = described | {"shape": list(feature.shape), "names": list(feature.names)}
    columns |= {name: {"dtype": kind, "unit": _UNITS.get(name)} for name, kind in INDEX_COLUMNS.items()}
    return {
        "columns": columns,
        "pictures": {
            feature.key: {"shape": list(feature.shape), "path": pictures_of(layout, feature.key)}
            for feature in layout.features.pictures
        },
    }


_UNITS = {"timestamp": "s", STAMP: "ns"}


def pictures_of(layout: DatasetLayout, key: str) -> str:
    """Return the path template of an episode's pictures."""
    template = VIDEO_PATH if layout.pictures == "video" else PICTURES_PATH
    return template.replace("{video_key}", key)


def episode_columns(found: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Return the statistics of an episode as columns of its row."""
    return {f"stats/{key}/{name}": value for key, values in found.items() for name, value in values.items()}

"""Read data sets, one episode at a time: those of JOSHUA, and those of LeRobot in its layouts v3.0 and v2.1.

Data sets are not trusted: paths stay inside its folder, sizes are checked before anything is decoded.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import av
import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq
from joshua.api.files import UnsafePathError, file_inside, filled, inside
from joshua.features import FeatureSet
from joshua.tools import parse_json

from joshua_dataset import statistics
from joshua_dataset.decoding import DatasetError as DatasetError
from joshua_dataset.decoding import Pictures, pictures_of_video, unreadable
from joshua_dataset.decoding import picture_of as picture_of
from joshua_dataset.meta_files import read_info, read_json, read_lines, read_tasks
from joshua_dataset.metadata import (
    EPISODES_STATS,
    INDEX_COLUMNS,
    INFO,
    MESSAGES,
    OURS,
    STATS,
    array_of,
    is_list,
)
from joshua_dataset.statistics import Statistics

#: Most rows of a table that is read: a compressed one can hold any number.
MOST_ROWS = 20_000_000

#: Number types of a feature.
NUMBER_TYPES = (
    *("float32", "float64", "float16", "bool", "int64", "int32", "int16", "int8"),
    *("uint8", "uint16", "uint32", "uint64"),
)

VERSIONS = ("v3.0", "v2.1", "v2.0")


@dataclass(frozen=True)
class Episode:
    """One episode of a data set.

    Attributes:
        index: in the data set; length: frames; tasks: what it shows.
        table: file with its rows; pictures: by feature.
        statistics: by feature, as the metadata have them; counts: by name, such as ``dropped``.
    """

    index: int
    length: int
    tasks: tuple[str, ...]
    table: Path
    pictures: Mapping[str, Pictures] = field(default_factory=dict)
    statistics: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    counts: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class Dataset:
    """Metadata of a data set.

    Attributes:
        folder: of the data set; version: of LeRobot's layout; format: as ``writer_of`` takes it.
        fps: frames per second; robot_type: what was recorded; features: of each frame.
        episodes, frames: how many; tasks: by their index.
        pictures: ``video``, ``png``, ``jpeg``, ``table``, if the tables contain the pictures, or
            ``messages``, if ROS 2 messages contain all values.
        codec: of the videos; "" without any.
        identity: what appended episodes must share; counters: names of the counts of each episode.
        topics: of the features, for a data set of messages.
        info: the whole ``meta/info.json``.
    """

    folder: Path
    version: str
    format: str
    fps: int
    robot_type: str
    features: FeatureSet
    episodes: int
    frames: int
    tasks: tuple[str, ...]
    pictures: str
    codec: str
    identity: Mapping[str, str]
    counters: tuple[str, ...]
    topics: Mapping[str, str]
    info: Mapping[str, Any]

    @classmethod
    def read(cls, folder: Path) -> Dataset:
        """Read the metadata. Raises DatasetError."""
        info = read_info(folder)
        found = cls.of(folder, info)
        try:
            tasks = tuple(str(text) for _, text in sorted(read_tasks(folder, found.version)))
        except (KeyError, TypeError, ValueError) as error:
            raise DatasetError(
                f"{folder}: the table of tasks is not valid: {type(error).__name__}: {error}"
            ) from error
        return replace(found, tasks=tasks)

    @classmethod
    def of(cls, folder: Path, info: Mapping[str, Any]) -> Dataset:
        """Return what ``meta/info.json`` says, without the tasks. Raises DatasetError.

        Args:
            folder: of the data set; info: content of the file.
        """
        version = str(info.get("codebase_version", ""))
        if version not in VERSIONS:
            raise DatasetError(
                f"{folder / INFO} has the codebase_version {version or 'none'}; "
                f"allowed: {', '.join(VERSIONS)}"
            )
        try:
            described = info["features"]
            features = FeatureSet.from_lerobot(described)
            ours = info.get(OURS, {})
            kinds = {str(described[feature.key]["dtype"]) for feature in features.pictures}
            pictures = str(ours.get("pictures", "table" if kinds == {"image"} else "video"))
            codecs = {_codec(described[feature.key]) for feature in features.pictures}
            found = cls(
                folder=folder,
                version=version,
                format=str(ours.get("format", "lerobot")),
                fps=int(info["fps"]),
                robot_type=str(info.get("robot_type") or ""),
                features=features,
                episodes=int(info["total_episodes"]),
                frames=int(info["total_frames"]),
                tasks=(),
                pictures=pictures,
                codec=", ".join(sorted(codecs)),
                identity={str(k): str(v) for k, v in ours.get("identity", {}).items()},
                counters=tuple(map(str, ours.get("counters", ()))),
                topics={str(k): str(v) for k, v in ours.get("topics", {}).items()},
                info=info,
            )
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise DatasetError(f"{folder / INFO} is not valid: {type(error).__name__}: {error}") from error
        for feature in features.numbers:
            if feature.dtype not in NUMBER_TYPES:
                raise DatasetError(
                    f"{folder / INFO}: {feature.key} has the dtype {feature.dtype!r}; "
                    f"allowed: {', '.join(NUMBER_TYPES)}"
                )
        if found.fps <= 0 or found.episodes < 0 or found.frames < 0:
            raise DatasetError(f"{folder / INFO} has a negative count, or no fps")
        return found

    def statistics(self) -> dict[str, Statistics]:
        """Statistics of the whole data set, by feature. Raises DatasetError."""
        try:
            if self.version == "v2.1" and not (self.folder / STATS).exists():
                return self._merged_statistics()
            record = read_json(self.folder, STATS)
            return {str(key): statistics.from_json(values) for key, values in record.items()}
        except (AttributeError, KeyError, IndexError, TypeError, ValueError) as error:
            raise DatasetError(f"{self.folder / STATS} is not valid: {error}") from error

    def _merged_statistics(self) -> dict[str, Statistics]:
        """Merge the statistics of a layout that stores them only by episode."""
        found: dict[str, Statistics] = {}
        for episode in self.episode_list():
            for key, record in episode.statistics.items():
                part = statistics.from_json(record)
                found[key] = statistics.merged([found[key], part]) if key in found else part
        return found

    def episode_list(
        self, wanted: set[int] | None = None, *, with_statistics: bool = True
    ) -> Iterator[Episode]:
        """Yield the episodes that the data set counts, in order. Raises DatasetError.

        Args:
            wanted: their indices; None for all.
            with_statistics: read their statistics, too, which must be readable then.
        """
        read_rows = self._rows_v3 if self.version == "v3.0" else self._rows_v2
        for row in read_rows(with_statistics):
            try:
                index = int(row["episode_index"])
            except (KeyError, TypeError, ValueError) as error:
                raise self._odd_row(error) from error
            if index < self.episodes and (wanted is None or index in wanted):
                yield self.episode_of(row)

    def episode_of(self, row: Mapping[str, Any]) -> Episode:
        """Return the episode that a row of the table of episodes describes. Raises DatasetError."""
        try:
            index = int(row["episode_index"])
            return self._episode(row, index)
        except UnsafePathError as error:
            raise DatasetError(f"{self.folder / 'meta'}: episode {index}: {error}") from error
        except (KeyError, TypeError, ValueError, IndexError) as error:
            raise self._odd_row(error) from error

    def _odd_row(self, error: Exception) -> DatasetError:
        return DatasetError(
            f"{self.folder / 'meta'}: the row of an episode is not valid: {type(error).__name__}: {error}"
        )

    def columns(self, episode: Episode) -> dict[str, npt.NDArray[Any]]:
        """Return the numbers of an episode, (N,) or (N, D) by column. Raises DatasetError."""
        if self.pictures == MESSAGES:
            raise DatasetError(
                f"{self.folder} contains ROS 2 messages, not frames. Convert it to frames with `joshua "
                f"dataset convert {self.folder} TARGET`, or open {episode.table} with rosbag2 or Foxglove"
            )
        table = self._table(episode)
        found: dict[str, npt.NDArray[Any]] = {}
        for name in table.column_names:
            if name in self.features and self.features[name].is_picture:
                continue
            found[name] = array_of(table.column(name))
        if self.format == "csv":
            found = self._gathered(found)
        for name in (name for name in INDEX_COLUMNS if name in found):
            if found[name].ndim != 1 or found[name].dtype.kind not in "iuf":
                raise DatasetError(f"{episode.table}: the column {name} does not contain numbers")
        for feature in self.features.numbers:
            values = found.get(feature.key)
            if values is None:
                raise DatasetError(f"{episode.table} lacks the column {feature.key}")
            wanted = (len(table), *feature.shape)
            if values.shape != wanted and values.size == int(np.prod(wanted)):
                found[feature.key] = values = values.reshape(wanted)
            if values.shape != wanted or values.dtype == object:
                raise DatasetError(
                    f"{episode.table}: {feature.key} has the shape {values.shape[1:]}, "
                    f"and {feature.shape} is described"
                )
        return found

    def has_lists_of_one(self) -> bool:
        """Return whether the tables store features of one number as lists. Raises DatasetError."""
        single = {feature.key for feature in self.features.numbers if feature.shape == (1,)}
        first = next(self.episode_list(), None) if single else None
        if first is None:
            return False
        schema = self._table(first).schema
        return any(field.name in single and is_list(field.type) for field in schema)

    def decoded(self, episode: Episode, key: str) -> Iterator[npt.NDArray[np.uint8]]:
        """Yield the pictures of an episode, (H, W, 3) RGB, in order. Raises DatasetError."""
        height, width, _ = self.features[key].shape
        where = episode.pictures[key]
        try:
            if self._kind(key) == "table":
                for value in self._table(episode).column(key):
                    yield picture_of(value.as_py()["bytes"], where.path, height, width)
            elif self._kind(key) == "video":
                file_inside(self.folder, where.path, "the video")
                yield from pictures_of_video(where, self.fps, height, width)
            else:
                suffix = ".png" if self.pictures == "png" else ".jpg"
                for number in range(where.frames):
                    path = file_inside(self.folder, where.path / f"frame-{number:06d}{suffix}", "the picture")
                    yield picture_of(path.read_bytes(), path, height, width)
        except (OSError, av.FFmpegError, TypeError, KeyError, ValueError) as error:
            raise unreadable(where.path, error) from error

    def _kind(self, key: str) -> str:
        """Return how the pictures of a feature are stored; LeRobot decides this for each camera."""
        if OURS in self.info:
            return self.pictures
        return "table" if self.info["features"][key]["dtype"] == "image" else "video"

    def _table(self, episode: Episode) -> pa.Table:
        path = episode.table
        try:
            file_inside(self.folder, path, "the table")
            if path.suffix == ".csv":
                table = pa_csv.read_csv(path)
            elif path.suffix == ".jsonl":
                with path.open(encoding="utf-8") as file:
                    table = pa.Table.from_pylist([parse_json(line) for line in file])
            else:
                rows = pq.read_metadata(path).num_rows
                if rows > MOST_ROWS:
                    raise DatasetError(f"{path} has {rows} rows; at most {MOST_ROWS} are read")
                table = pq.read_table(path, filters=[("episode_index", "=", episode.index)])
            if "episode_index" not in table.column_names:
                raise DatasetError(f"{path} lacks the column episode_index")
            return table
        except (OSError, ValueError, TypeError, pa.ArrowException) as error:
            raise unreadable(path, error) from error

    def _gathered(self, columns: Mapping[str, Any]) -> dict[str, Any]:
        """Gather the columns of a CSV table, each vector in one column."""
        found = dict(columns)
        for feature in self.features.numbers:
            names = feature.names or tuple(map(str, range(feature.shape[0])))
            parts = [found.pop(f"{feature.key}.{name}", None) for name in names]
            if all(part is not None for part in parts):
                found[feature.key] = np.stack([np.asarray(part) for part in parts], axis=1)
        return found

    def _rows_v3(self, with_statistics: bool) -> Iterator[dict[str, Any]]:
        folder = self.folder / "meta" / "episodes"
        try:
            paths = [
                file_inside(self.folder, path)
                for chunk in sorted(inside(self.folder, folder).glob("chunk-*"))
                for path in sorted(inside(self.folder, chunk).glob("file-*.parquet"))
            ]
        except OSError as error:
            raise unreadable(folder, error) from error
        for path in paths:
            try:
                with pq.ParquetFile(path) as file:
                    names = [name for name in file.schema_arrow.names if not name.startswith("stats/")]
                    columns = None if with_statistics else names
                    # A file has few rows, which start no threads that are worth it.
                    for batch in file.iter_batches(batch_size=64, columns=columns, use_threads=False):
                        yield from batch.to_pylist()
            except (OSError, pa.ArrowException) as error:
                raise unreadable(path, error) from error

    def _rows_v2(self, with_statistics: bool) -> Iterator[dict[str, Any]]:
        meta = self.folder / "meta"
        stored = read_lines(self.folder, self.folder / EPISODES_STATS, False) if with_statistics else ()
        found = {int(r["episode_index"]): r.get("stats", {}) for r in stored}
        for row in read_lines(self.folder, meta / "episodes.jsonl", True):
            yield row | {"stats": found.get(int(row["episode_index"]), {})}

    def table_of(self, row: Mapping[str, Any]) -> Path:
        """Return the table of the episode that a row describes. Raises DatasetError."""
        try:
            return self._table_of(row, int(row["episode_index"]))
        except UnsafePathError as error:
            raise DatasetError(f"{self.folder / 'meta'}: {error}") from error
        except (KeyError, TypeError, ValueError, IndexError) as error:
            raise self._odd_row(error) from error

    def _table_of(self, row: Mapping[str, Any], index: int) -> Path:
        if self.version == "v3.0":
            file = {name: int(row[f"data/{name}"]) for name in ("chunk_index", "file_index")}
        else:
            file = self._file_of(index)
        return self._inside(str(self.info["data_path"]), file)

    def _file_of(self, index: int) -> dict[str, int]:
        """Return what the templates of the layout v2 need."""
        size = int(self.info.get("chunks_size", 1000))
        if size < 1:
            raise ValueError(f"chunks_size is {size}")
        return {"episode_chunk": index // size, "episode_index": index}

    def _episode(self, row: Mapping[str, Any], index: int) -> Episode:
        info, length = self.info, int(row["length"])
        table = self._table_of(row, index)
        file = self._file_of(index) if self.version != "v3.0" else {}
        if self.version == "v3.0":
            found: dict[str, dict[str, Any]] = {}
            for name, value in row.items():
                if name.startswith("stats/") and value is not None:
                    key, _, which = name.removeprefix("stats/").rpartition("/")
                    found.setdefault(key, {})[which] = value
        else:
            found = dict(row["stats"])
        pictures = {}
        for feature in self.features.pictures if self.pictures != MESSAGES else ():
            key, path, from_s = feature.key, table, 0.0
            if self._kind(key) != "table":
                if self.version == "v3.0":
                    names = ("chunk_index", "file_index")
                    file = {name: int(row[f"videos/{key}/{name}"]) for name in names}
                    from_s = float(row[f"videos/{key}/from_timestamp"])
                path = self._inside(str(info["video_path"]), file | {"video_key": key})
            pictures[key] = Pictures(path, from_s, length)
        counts = {name: int(row.get(f"counts/{name}") or 0) for name in self.counters}
        return Episode(index, length, tuple(map(str, row["tasks"])), table, pictures, found, counts)

    def _inside(self, template: str, values: Mapping[str, Any]) -> Path:
        """Return a path in the data set. Raises UnsafePathError for one outside it."""
        return inside(self.folder, filled(template, values))


def _codec(described: Mapping[str, Any]) -> str:
    found = described.get("info") or described.get("video_info") or {}
    return str(found.get("video.codec", ""))

"""Writes a data set in the layout of LeRobot v3.

Each episode has files of its own, one table and one video for each camera. When it ends, its table and the
new metadata are written beside their places and put there together. So an episode that was dropped leaves
nothing behind, and a data set is whole at any time, even when the program is killed or the disk is full.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from typing import Any

import av
import numpy as np
import pyarrow as pa
from joshua.features import DatasetLayout, EpisodeError, EpisodeWriter, FeatureError, Frame, checked

from joshua_dataset import statistics
from joshua_dataset.metadata import CHUNK_SIZE, DATA_PATH, STAMP, VIDEO_PATH, data_schema, write_metadata
from joshua_dataset.staging import Staging
from joshua_dataset.statistics import Statistics
from joshua_dataset.video import VideoFile

#: Every how many frames a picture counts for the statistics.
PICTURE_STRIDE = 10


class LeRobotWriter(EpisodeWriter):
    """See ``EpisodeWriter``. Pictures become H.264 videos.

    Args:
        layout: what the data set holds; pictures have even widths and heights.
    """

    def __init__(self, layout: DatasetLayout) -> None:
        super().__init__(layout)
        self._schema: Any = data_schema(layout)
        self._rows: list[dict[str, Any]] = []
        self._statistics: list[dict[str, Statistics]] = []
        self._tasks: list[str] = []
        self._frames = 0
        self._videos: dict[str, VideoFile] = {}
        self._clear()

    def open(self) -> None:
        """Makes the folder. Raises EpisodeError."""
        layout = self.layout
        for feature in layout.features.values():
            if 0 in feature.shape or not (feature.is_picture or len(feature.shape) == 1):
                raise EpisodeError(f"{feature.key} has the shape {feature.shape}, which no column can have")
            if feature.is_picture and (feature.shape[0] % 2 or feature.shape[1] % 2):
                height, width, _ = feature.shape
                raise EpisodeError(
                    f"{feature.key} is {width} x {height}: a video needs an even width and height"
                )
        try:
            if layout.folder.exists() and any(layout.folder.iterdir()):
                raise EpisodeError(
                    f"{layout.folder} is not empty, and data sets are never overwritten: "
                    "name another local_path, or move the folder away"
                )
            layout.folder.mkdir(parents=True, exist_ok=True)
            (layout.folder / "meta").mkdir()  # so that a second writer finds that it is taken
        except FileExistsError as error:
            raise EpisodeError(
                f"{layout.folder} is being written by another run, or is a file: name another local_path"
            ) from error
        except OSError as error:
            raise EpisodeError(
                f"{layout.folder} cannot be made: {error.strerror or error}; name another local_path"
            ) from error

    def add_frame(self, frame: Frame) -> None:
        """Adds a frame. Raises EpisodeError."""
        features = self.layout.features
        missing = [key for key in features if key not in frame.values]
        if missing:
            raise EpisodeError(f"a frame lacks {', '.join(missing)}")
        try:
            values = {key: checked(feature, frame[key]) for key, feature in features.items()}
            for feature in features.pictures:
                self._add_picture(feature.key, values[feature.key])
        except FeatureError as error:
            raise EpisodeError(str(error)) from error
        except (OSError, av.FFmpegError) as error:
            raise EpisodeError(f"{self.layout.folder} takes no picture: {error}") from error
        for feature in features.numbers:
            self._vectors[feature.key].append(values[feature.key])
        self._stamps.append(frame.stamp_ns)

    def end_episode(self, task: str) -> None:
        """Ends the episode: its files are completed, then the metadata replaced. Raises EpisodeError."""
        count = len(self._stamps)
        if not count:
            raise EpisodeError(f"{self.layout.folder}: an episode without a frame cannot be kept")
        tasks = self._tasks if task in self._tasks else [*self._tasks, task]
        columns = {
            **{key: np.stack(rows) for key, rows in self._vectors.items()},
            "timestamp": np.arange(count, dtype=np.float32) / np.float32(self.layout.fps),
            STAMP: np.array(self._stamps, dtype=np.int64),
            "frame_index": np.arange(count),
            "episode_index": np.full(count, self.episodes),
            "index": np.arange(self._frames, self._frames + count),
            "task_index": np.full(count, tasks.index(task)),
        }
        found = {key: statistics.of_rows(values.reshape(count, -1)) for key, values in columns.items()} | {
            key: statistics.of_pictures(pictures) for key, pictures in self._samples.items()
        }
        rows = [*self._rows, self._episode_row(count, task, found)]
        parts = [*self._statistics, found]
        staging = Staging()
        try:
            for video in self._videos.values():
                video.close()
            self._write_data(staging, columns)
            write_metadata(staging, self.layout, rows, parts, tasks)
            staging.commit()
        except (OSError, av.FFmpegError, pa.ArrowException) as error:
            staging.discard()
            raise EpisodeError(f"{self.layout.folder}: the episode cannot be kept: {error}") from error
        self._rows, self._statistics, self._tasks = rows, parts, tasks
        self.episodes += 1
        self._frames += count
        self._clear()

    def close(self) -> None:
        """Forgets an episode that has not ended, and a data set that has none."""
        super().close()
        if not self.episodes:
            self._remove_empty_folders()

    def drop_episode(self) -> None:
        """Forgets the present episode and removes its videos."""
        for video in self._videos.values():
            video.drop()
        self._clear()

    def _remove_empty_folders(self) -> None:
        folder = self.layout.folder
        for inner in sorted(folder.rglob("*"), reverse=True):
            with contextlib.suppress(OSError):  # what somebody else has put there stays
                inner.rmdir()
        with contextlib.suppress(OSError):
            folder.rmdir()

    @property
    def _place(self) -> dict[str, int]:
        """Where the files of the present episode stand."""
        return {"chunk_index": self.episodes // CHUNK_SIZE, "file_index": self.episodes % CHUNK_SIZE}

    def _clear(self) -> None:
        self._vectors: dict[str, list[Any]] = {feature.key: [] for feature in self.layout.features.numbers}
        self._samples: dict[str, list[Any]] = {feature.key: [] for feature in self.layout.features.pictures}
        self._videos.clear()
        self._stamps: list[int] = []

    def _add_picture(self, key: str, picture: Any) -> None:
        if key not in self._videos:
            path = self.layout.folder / VIDEO_PATH.format(video_key=key, **self._place)
            height, width, _ = picture.shape
            self._videos[key] = VideoFile(path, width, height, self.layout.fps)
        self._videos[key].add(picture)
        if len(self._stamps) % PICTURE_STRIDE == 0:
            self._samples[key].append(statistics.thinned(picture))

    def _write_data(self, staging: Staging, columns: Mapping[str, Any]) -> None:
        arrays = [
            pa.FixedSizeListArray.from_arrays(pa.array(columns[field.name].reshape(-1)), field.type.list_size)
            if pa.types.is_fixed_size_list(field.type)
            else pa.array(columns[field.name], field.type)
            for field in self._schema
        ]
        path = self.layout.folder / DATA_PATH.format(**self._place)
        staging.table(path, pa.Table.from_arrays(arrays, schema=self._schema))

    def _episode_row(self, count: int, task: str, found: Mapping[str, Statistics]) -> dict[str, Any]:
        place = self._place
        row: dict[str, Any] = {
            "episode_index": self.episodes,
            "tasks": [task],
            "length": count,
            "data/chunk_index": place["chunk_index"],
            "data/file_index": place["file_index"],
            "dataset_from_index": self._frames,
            "dataset_to_index": self._frames + count,
        }
        for picture in self.layout.features.pictures:
            row |= {
                f"videos/{picture.key}/chunk_index": place["chunk_index"],
                f"videos/{picture.key}/file_index": place["file_index"],
                f"videos/{picture.key}/from_timestamp": 0.0,
                f"videos/{picture.key}/to_timestamp": count / self.layout.fps,
            }
        for key, values in found.items():
            row |= {f"stats/{key}/{name}": value for name, value in statistics.as_json(values).items()}
        return row | {"meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0}

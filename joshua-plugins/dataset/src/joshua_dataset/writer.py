"""Writes a data set episode by episode, in LeRobot's v3 layout or as plain tables with the same columns.

Each episode has files of its own: a table, a video for each camera, a row of metadata. An episode is
complete when ``meta/info.json`` counts it, which is replaced last, after all else is safe on the disk. So a
discarded episode leaves nothing behind, a data set is complete at any time, and an episode costs the same
however many precede it.

An episode that cannot be written, or not be kept, stays on the disk as far as it is there. It can be kept
later, by this writer or by a repair.

Why one file: one class, whose every step reads or changes the state of the same open episode.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pyarrow as pa
from joshua.api.files import is_system_error
from joshua.features import (
    DatasetLayout,
    EpisodeError,
    EpisodeWriter,
    FeatureError,
    FeatureSet,
    Frame,
    checked,
)

from joshua_dataset import changes, metadata, open_episode, statistics
from joshua_dataset.changes import Change
from joshua_dataset.files import Files, cause, reason, remedy_first, remove_empty_folders
from joshua_dataset.lock import PRIVATE, WriterLock
from joshua_dataset.metadata import FOLDERS, INDEX_COLUMNS, INFO, STAMP, STATS, TASKS, check_layout
from joshua_dataset.open_episode import OpenEpisode
from joshua_dataset.pictures import ERRORS, Encoder
from joshua_dataset.reader import Dataset, DatasetError
from joshua_dataset.salvage import Salvaged, salvage
from joshua_dataset.statistics import Statistics

_ANOTHER = "Name another local_path"


class NotKept(EpisodeError):
    """An episode is on the disk as far as it was written, and is not part of the data set yet.

    Args:
        folder: of the data set; error: why.

    Attributes:
        error: why.
    """

    def __init__(self, folder: Path, error: Exception) -> None:
        super().__init__(folder, error)
        self._folder, self.error = folder, error

    def __str__(self) -> str:
        return self.text(f"run `joshua dataset repair {self._folder}`")

    def text(self, then: str) -> str:
        """Return the message.

        Args:
            then: what to do when the cause is removed.
        """
        return (
            f"{self._folder}: the episode cannot be kept: {cause(self.error)}. Nothing of it was removed: "
            f"it is in {open_episode.open_folder(self._folder)}. {remedy_first(self.error, then)}"
        )


class DatasetWriter(EpisodeWriter):
    """See ``EpisodeWriter``.

    Args:
        layout: what the data set holds; videos have even widths and heights.
        files: file operations.

    Attributes:
        frames: of all episodes that have ended.
        task: given by a repair to an episode that was never ended.
        kept: episodes of the session before the open one.
        aside: place of what could not be mended of the last episode; None if all of it was.
    """

    format: ClassVar[str]

    def __init__(self, layout: DatasetLayout, files: Files | None = None) -> None:
        super().__init__(layout)
        self._files = files or Files()
        self._lock = WriterLock(layout.folder)
        schema = metadata.data_schema(layout)
        self._schema: Any = schema
        kept = [field for field in schema if field.name not in INDEX_COLUMNS or field.name == STAMP]
        self._row_schema = pa.schema(kept)
        self._statistics: dict[str, Statistics] = {}
        self._tasks: list[str] = []
        self._open: OpenEpisode | None = None
        self._finished: tuple[Mapping[str, Any], Mapping[str, Statistics]] | None = None
        self._decided: Decided | None = None
        self.frames = 0
        self.task = ""
        self.kept = 0
        self.aside: Path | None = None

    @property
    def open_frames(self) -> int:
        """Frames of the open episode."""
        return self._open.frames if self._open is not None else 0

    @property
    def open_s(self) -> float:
        """Length of the open episode."""
        return self.open_frames / self.layout.fps

    @property
    def waiting(self) -> int:
        """Pictures that wait for their encoder, for the slowest camera."""
        return max((item.waiting for item in self._encoders), default=0)

    @property
    def busy_s(self) -> float:
        """Processor time of the encoders of the open episode."""
        return sum((item.busy_s for item in self._encoders), 0.0)

    def check(self) -> None:
        """Refuse what ``open`` would refuse, without writing; features of unknown shape are skipped.

        Raises:
            EpisodeError: as ``open``.
        """
        check_layout(self.layout, self.format, whole=False)
        folder = self.layout.folder
        try:
            there = next(path for path in (folder, *folder.parents) if path.exists())
            if not os.access(there, os.W_OK | os.X_OK) or not there.is_dir():
                what = "not writable" if there.is_dir() else "not a folder"
                raise EpisodeError(f"{folder} cannot be written: {there} is {what}. {_ANOTHER}")
            found = self._found()
            self._lock.require_free()
            if changes.is_interrupted(folder):
                raise interrupted(folder)
            self._require_finished()
            if found:
                self._readable()
        except OSError as error:
            raise self._unwritable(error) from error

    def open(self) -> None:
        """See ``EpisodeWriter``."""
        check_layout(self.layout, self.format)
        folder = self.layout.folder
        try:
            self._found()
            self._files.make_folder(folder)
            self._lock.take()
            try:
                changes.recover(folder, self._files)
                self._require_finished()
                if self._found():
                    self._take_up(self._readable())
            except BaseException:
                self._lock.release()
                raise
        except OSError as error:
            raise self._unwritable(error) from error

    def add_frame(self, frame: Frame) -> None:
        """See ``EpisodeWriter``."""
        features = self.layout.features
        missing = [key for key in features if key not in frame.values]
        if missing:
            raise EpisodeError(f"a frame lacks {', '.join(missing)}")
        try:
            values = {key: checked(feature, frame[key]) for key, feature in features.items()}
            if self._open is None:
                self._open = OpenEpisode(
                    self.layout, self._row_schema, self.episodes, self._journal(), self._files
                )
            if self._open.has_failed:
                raise EpisodeError(
                    f"{self.layout.folder} takes no frame: the episode has ended with an error"
                )
            self._open.add(frame.stamp_ns, values)
        except FeatureError as error:
            raise EpisodeError(str(error)) from error
        except (*ERRORS, pa.ArrowException) as error:
            raise EpisodeError(f"{self.layout.folder} takes no frame: {reason(error)}") from error

    def end_episode(self, task: str, counts: Mapping[str, int] | None = None) -> None:
        """See ``EpisodeWriter``; after an error, call it again when the cause is removed."""
        if self._open is None:
            raise EpisodeError(f"{self.layout.folder}: an episode without a frame cannot be kept")
        if self._decided is not None:
            self._complete_decided()
        else:
            self._finish_and_keep(self._open, task, counts or {})
        self._open = self._finished = None

    def _finish_and_keep(self, episode: OpenEpisode, task: str, counts: Mapping[str, int]) -> None:
        """Complete the files of an episode and keep it; without its codecs, what is whole of it."""
        try:
            self._finished = self._finished or episode.finish()
        except (*ERRORS, pa.ArrowException) as error:
            if is_system_error(error):
                raise self._not_kept(error) from error
            if not self.keep_whole(task, counts):
                folder = self.layout.folder
                raise EpisodeError(
                    f"{folder}: the episode cannot be kept: {error}. Discard it, or end the recording and "
                    f"run `joshua dataset repair {folder}` to move its files aside"
                ) from error
            return
        self.keep(*self._finished, task, counts)

    def keep_whole(self, task: str, counts: Mapping[str, int]) -> int:
        """Keep what is whole of the open episode on the disk; return the number of its frames, 0 for none.

        Raises:
            EpisodeError: the system does not let it be read or kept; everything stays where it is.
        """
        try:
            found = salvage(self.layout, self._files)
        except (*ERRORS, pa.ArrowException) as error:
            raise self._not_kept(error) from error
        if found.length:
            self.keep(found.columns, found.pictures, task, counts, found)
        return found.length

    def keep(
        self,
        columns: Mapping[str, Any],
        pictures: Mapping[str, Statistics],
        task: str,
        counts: Mapping[str, int],
        found: Salvaged | None = None,
    ) -> None:
        """Put the open episode, whose files are complete, into the data set.

        Args:
            found: where its pictures are, if not where they were recorded.

        Raises:
            EpisodeError: it stays the open episode, and another call may keep it.
        """
        if self._decided is None:
            try:
                self._decided = self._prepared(columns, pictures, task, counts, found)
            except (*ERRORS, pa.ArrowException) as error:
                raise self._not_kept(error) from error
        self._complete_decided()

    def _complete_decided(self) -> None:
        """Make the moves of a prepared episode, and count it. Raises EpisodeError."""
        assert self._decided is not None
        try:
            self._decided.change.commit()
        except (*ERRORS, pa.ArrowException) as error:
            if not self._decided.change.is_decided:
                self._decided.change.discard()
                self._decided = None
            raise self._not_kept(error) from error
        kept, self._decided = self._decided, None
        self._statistics, self._tasks = kept.statistics, kept.tasks
        self.episodes += 1
        self.frames += kept.length
        self.aside = kept.aside

    def _prepared(
        self,
        columns: Mapping[str, Any],
        pictures: Mapping[str, Statistics],
        task: str,
        counts: Mapping[str, int],
        salvaged: Salvaged | None,
    ) -> Decided:
        """Write the files that the episode adds. Raises ``ERRORS`` and ArrowException."""
        length = len(columns[STAMP])
        tasks = self._tasks if task in self._tasks else [*self._tasks, task]
        whole = {
            **columns,
            "timestamp": np.arange(length, dtype=np.float32) / np.float32(self.layout.fps),
            "frame_index": np.arange(length),
            "episode_index": np.full(length, self.episodes),
            "index": np.arange(self.frames, self.frames + length),
            "task_index": np.full(length, tasks.index(task)),
        }
        found = {key: statistics.of_rows(values.reshape(length, -1)) for key, values in whole.items()} | dict(
            pictures
        )
        together = {
            key: statistics.merged([self._statistics[key], part]) if key in self._statistics else part
            for key, part in found.items()
        }
        change = Change(self.layout.folder, self._files)
        try:
            change.begin()
            sources = {} if salvaged is None else salvaged.sources
            self._stage(change, whole, found, together, tasks, task, counts, sources)
            aside = self._clear(change, salvaged is not None and salvaged.is_damaged)
        except BaseException:
            change.discard()
            raise
        return Decided(change, length, together, tasks, aside)

    def _clear(self, change: Change, is_damaged: bool) -> Path | None:
        """Take the rest of the open episode away with a change; return where a damaged one goes."""
        place = open_episode.open_folder(self.layout.folder)
        if is_damaged:
            return change.move_aside(place, open_episode.aside_name(self.episodes))
        change.drop(place)
        return None

    def drop_episode(self) -> None:
        """See ``EpisodeWriter``; an episode that only lacks its last moves is kept."""
        if self._decided is not None:
            with contextlib.suppress(EpisodeError):  # it stays the open episode
                self._complete_decided()
                self._open = self._finished = None
            return
        if self._open is not None:
            self._open.drop()
        self._open = self._finished = None

    def leave(self) -> None:
        """Close the data set, and leave an open episode on the disk for a repair. Idempotent."""
        if self._open is not None:
            with contextlib.suppress(*ERRORS, pa.ArrowException):  # what is on the disk stays there
                self._open.finish()
            self._open = self._finished = self._decided = None
        self.close()

    def close(self) -> None:
        """See ``EpisodeWriter``. An episode that could not be written or kept stays on the disk.

        A data set without an episode is removed.
        """
        if self._open is not None and (self._open.has_failed or self._finished is not None):
            self.leave()
            return
        super().close()
        self._lock.release()
        if not self.episodes:
            self._remove_empty_folders()

    @property
    def _encoders(self) -> list[Encoder]:
        return list(self._open.encoders.values()) if self._open is not None else []

    def _found(self) -> bool:
        """Return whether there is a data set to append to. Raises OSError; EpisodeError if it is unfit."""
        folder = self.layout.folder
        # a change that was killed before it was decided leaves empty folders
        found = folder.exists() and any(
            _holds_file(path) for path in folder.iterdir() if path.name != PRIVATE
        )
        if found and not self.layout.resume:
            raise EpisodeError(
                f"{folder} is not empty, and data sets are never overwritten. "
                "Name another local_path, move the folder away, or append with resume: true"
            )
        return found

    def _require_finished(self) -> None:
        folder = self.layout.folder
        if open_episode.read_journal(folder) is not None:
            raise EpisodeError(
                f"{folder} has an episode that a killed recording left unfinished. "
                f"Run `joshua dataset repair {folder}` to keep it, or with --cut to discard it"
            )

    def _readable(self) -> Dataset:
        """The data set that exists. Raises EpisodeError if it cannot be appended to."""
        layout = self.layout
        try:
            there = Dataset.read(layout.folder)
        except DatasetError as error:
            raise EpisodeError(f"{layout.folder} cannot be appended to: {error}") from error
        different = self._differences(there)
        if different:
            raise EpisodeError(
                f"{layout.folder} cannot be appended to, because it differs: " + "; ".join(different)
            )
        return there

    def _unwritable(self, error: OSError) -> EpisodeError:
        return EpisodeError(f"{self.layout.folder} cannot be written: {error.strerror or error}. {_ANOTHER}")

    def take_up(self, lock: WriterLock) -> None:
        """Continue a data set whose lock is held, whatever its features. Raises EpisodeError."""
        self._lock = lock
        if (self.layout.folder / INFO).exists():
            try:
                self._take_up(Dataset.read(self.layout.folder))
            except DatasetError as error:
                raise EpisodeError(str(error)) from error

    def _journal(self) -> dict[str, Any]:
        info = metadata.info(self.layout, self.format, episodes=0, frames=0, tasks=0)
        return {"task": self.task, "info": info, "kept": self.kept}

    def _take_up(self, there: Dataset) -> None:
        self.episodes, self.frames = there.episodes, there.frames
        self._tasks = list(there.tasks)
        try:
            self._statistics = there.statistics()
            if there.has_lists_of_one():  # the tables of a data set have the same columns
                self._schema = metadata.data_schema(self.layout, lists_of_one=True)
        except DatasetError as error:
            raise EpisodeError(str(error)) from error

    def _differences(self, there: Dataset) -> list[str]:
        layout = self.layout
        found = []
        pairs = {
            "format": (self.format, there.format),
            "fps": (layout.fps, there.fps),
            "robot_type": (layout.robot_type, there.robot_type),
            "pictures": (layout.pictures, there.pictures),
            **{name: (value, there.identity.get(name, value)) for name, value in layout.identity.items()},
        }
        for name, (ours, theirs) in pairs.items():
            if ours != theirs:
                found.append(f"{name} is {ours} here and {theirs} there")
        # a sensor without a received message has no shape to compare
        known = {
            key: there.features[key] if 0 in feature.shape and key in there.features else feature
            for key, feature in layout.features.items()
        }
        return found + FeatureSet(known.values()).differences(there.features)

    def _stage(
        self,
        change: Change,
        columns: Mapping[str, Any],
        found: Mapping[str, Statistics],
        together: Mapping[str, Statistics],
        tasks: list[str],
        task: str,
        counts: Mapping[str, int],
        sources: Mapping[str, Path],
    ) -> None:
        folder, place = self.layout.folder, metadata.place(self.episodes)
        for feature in self.layout.features.pictures:
            template = metadata.pictures_of(self.layout, feature.key)
            source = sources.get(feature.key, open_episode.pictures_path(self.layout, feature.key))
            target = folder / template.format(**place)
            change.clear(target)
            change.put(source, target)
        path = folder / (metadata.DATA_PATH.format(**place) + metadata.SUFFIXES[self.format])
        change.clear(path)
        change.table(path, self._table(columns))
        if self.format != "lerobot" and not self.episodes:
            change.json(folder / "schema.json", metadata.table_schema(self.layout, self.format))
        row = self._episode_row(len(columns[STAMP]), task, found, counts)
        described = folder / metadata.EPISODES_PATH.format(**place)
        change.clear(described)
        change.table(described, pa.Table.from_pylist([row]))
        if tasks != self._tasks:
            change.table(folder / TASKS, metadata.tasks_table(tasks))
        change.json(folder / STATS, {key: statistics.as_json(value) for key, value in together.items()})
        frames = self.frames + len(columns[STAMP])
        info = metadata.info(
            self.layout, self.format, episodes=self.episodes + 1, frames=frames, tasks=len(tasks)
        )
        change.json(folder / INFO, info, last=True)  # it counts the episode

    def _table(self, columns: Mapping[str, Any]) -> pa.Table:
        if self.format == "csv":
            return metadata.flat_table({name: columns[name] for name in self._schema.names}, self.layout)
        arrays = [metadata.column_of(columns[field.name], field.type) for field in self._schema]
        return pa.Table.from_arrays(arrays, schema=self._schema)

    def _episode_row(
        self, length: int, task: str, found: Mapping[str, Statistics], counts: Mapping[str, int]
    ) -> dict[str, Any]:
        place = metadata.place(self.episodes)
        row: dict[str, Any] = {
            "episode_index": self.episodes,
            "tasks": [task],
            "length": length,
            "data/chunk_index": place["chunk_index"],
            "data/file_index": place["file_index"],
            "dataset_from_index": self.frames,
            "dataset_to_index": self.frames + length,
        }
        for picture in self.layout.features.pictures:
            row |= {
                f"videos/{picture.key}/chunk_index": place["chunk_index"],
                f"videos/{picture.key}/file_index": place["file_index"],
                f"videos/{picture.key}/from_timestamp": 0.0,
                f"videos/{picture.key}/to_timestamp": length / self.layout.fps,
            }
        row |= metadata.episode_columns({key: statistics.as_json(value) for key, value in found.items()})
        row |= {f"counts/{name}": int(counts.get(name, 0)) for name in self.layout.counters}
        return row | {f"meta/episodes/{name}": value for name, value in place.items()}

    def _not_kept(self, error: Exception) -> NotKept:
        return NotKept(self.layout.folder, error)

    def _remove_empty_folders(self) -> None:
        folder = self.layout.folder
        for name in (*FOLDERS, PRIVATE):
            remove_empty_folders(folder / name)
            with contextlib.suppress(OSError):  # files of others stay
                (folder / name).rmdir()
        with contextlib.suppress(OSError):
            folder.rmdir()


@dataclass(frozen=True)
class Decided:
    """An episode whose files are ready to be moved into place, and the data set after that.

    Attributes:
        aside: place of what could not be mended of it; None if all is.
    """

    change: Change
    length: int
    statistics: dict[str, Statistics]
    tasks: list[str]
    aside: Path | None


def _holds_file(path: Path) -> bool:
    """Return whether a path is anything but a folder of empty folders. Raises OSError."""
    if path.is_symlink() or not path.is_dir():
        return True
    return any(_holds_file(inner) for inner in path.iterdir())


def interrupted(folder: Path) -> EpisodeError:
    """Return the error of a data set with a change that is not complete."""
    return EpisodeError(
        f"{folder} has a change that was interrupted. Run `joshua dataset repair {folder}` to complete it"
    )


class LeRobotWriter(DatasetWriter):
    """Data sets in the layout of LeRobot v3."""

    format = "lerobot"


class ParquetWriter(DatasetWriter):
    """Tables in Parquet, pictures beside them."""

    format = "parquet"


class CsvWriter(DatasetWriter):
    """Comma-separated values, a column for each number."""

    format = "csv"


class JsonlWriter(DatasetWriter):
    """One JSON object per frame."""

    format = "jsonl"

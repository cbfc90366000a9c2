"""The open episode on the disk, as streams: a kill loses at most its last half second."""

from __future__ import annotations

import contextlib
import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from joshua.api.files import UnsafePathError, file_inside, inside, safe_name
from joshua.features import DatasetLayout

from joshua_dataset.lock import PRIVATE
from joshua_dataset.metadata import STAMP, array_of, column_of
from joshua_dataset.pictures import FRAGMENT_S, QUEUE_S, Encoder, PictureFiles, Video
from joshua_dataset.statistics import Statistics

ROWS = "rows.arrows"
JOURNAL = "episode.json"
SUFFIXES = {"video": ".mp4", "png": "", "jpeg": ""}


def open_folder(folder: Path) -> Path:
    """Return the folder of a data set's open episode. Raises UnsafePathError for one elsewhere."""
    return inside(folder, Path(PRIVATE) / "open", "the open episode")


class OpenEpisode:
    """Files of one episode, invisible to readers of the data set.

    Args:
        layout: of the data set; schema: of the rows: numbers of the features and stamps.
        number: of the episode; journal: what a repair needs to complete it.

    Raises:
        OSError, av.FFmpegError: writing fails. The methods raise them, too.
    """

    def __init__(
        self, layout: DatasetLayout, schema: pa.Schema, number: int, journal: Mapping[str, Any]
    ) -> None:
        self._layout, self._schema = layout, schema
        self.folder = open_folder(layout.folder)
        self.encoders: dict[str, Encoder] = {}
        self.frames = 0
        self._rows: list[dict[str, Any]] = []
        self._flush_every = max(1, round(layout.fps * FRAGMENT_S / 2))
        shutil.rmtree(self.folder, ignore_errors=True)
        self.folder.mkdir(parents=True)
        (self.folder / JOURNAL).write_text(json.dumps({"episode_index": number, **journal}), encoding="utf-8")
        self._file: Any = (self.folder / ROWS).open("wb")
        try:
            self._stream: Any = pa.ipc.new_stream(self._file, schema)
            for feature in layout.features.pictures:
                self.encoders[feature.key] = self._encoder(feature.key, *feature.shape[:2])
        except BaseException:
            self.drop()
            raise

    def add(self, stamp_ns: int, values: Mapping[str, Any]) -> None:
        """Add a frame of checked values."""
        for key, encoder in self.encoders.items():
            encoder.add(values[key])
        self._rows.append(
            {STAMP: stamp_ns}
            | {key: values[key] for key in self._layout.features if key not in self.encoders}
        )
        self.frames += 1
        if len(self._rows) >= self._flush_every:
            self._flush()

    def finish(self) -> tuple[dict[str, Any], dict[str, Statistics]]:
        """Complete all files; return the columns, (N, …) each, and the statistics of the pictures."""
        self._flush()
        self._stream.close()
        self._file.close()
        found = {key: encoder.finish() for key, encoder in self.encoders.items()}
        rows = rows_of(self._layout.folder)
        if rows is None or len(rows) != self.frames:
            raise OSError(f"{self.folder / ROWS} cannot be read back")
        return columns_of(rows), found

    def pictures(self, key: str) -> Path:
        """Return the file or folder of the pictures of a feature."""
        return pictures_path(self._layout, key)

    def drop(self) -> None:
        """Remove everything. Idempotent."""
        for encoder in self.encoders.values():
            encoder.drop()
        with contextlib.suppress(OSError):  # buffered data is dropped anyway
            self._file.close()
        remove(self._layout.folder)

    def _encoder(self, key: str, height: int, width: int) -> Encoder:
        path, kind = self.pictures(key), self._layout.pictures
        target = (
            Video(path, width, height, self._layout.fps, self._layout.codec)
            if kind == "video"
            else PictureFiles(path, ".png" if kind == "png" else ".jpg")
        )
        return Encoder(target, key, round(QUEUE_S * self._layout.fps))

    def _flush(self) -> None:
        if not self._rows:
            return
        arrays = [
            column_of(np.asarray([row[field.name] for row in self._rows]), field.type)
            for field in self._schema
        ]
        self._stream.write_batch(pa.record_batch(arrays, schema=self._schema))
        self._file.flush()
        self._rows.clear()


def pictures_path(layout: DatasetLayout, key: str) -> Path:
    """Return the file or folder of the pictures of a feature in the open episode. Raises UnsafePathError."""
    name = f"{safe_name(key, 'the feature')}{SUFFIXES[layout.pictures]}"
    return inside(open_folder(layout.folder), name, "the pictures")


def remove(folder: Path) -> None:
    """Remove the open episode of a data set. Raises UnsafePathError for one elsewhere."""
    shutil.rmtree(open_folder(folder), ignore_errors=True)


def read_journal(folder: Path) -> dict[str, Any] | None:
    """Return the journal of an open episode; None if there is none, {} if a kill truncated it.

    Raises:
        UnsafePathError: it is elsewhere, or not a file.
    """
    try:
        path = file_inside(open_folder(folder), JOURNAL, "the description of the open episode")
        record = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {} if open_folder(folder).exists() else None
    except UnsafePathError:
        raise
    except (OSError, ValueError, RecursionError):
        return {}
    return record if isinstance(record, dict) and isinstance(record.get("episode_index"), int) else {}


def rows_of(folder: Path) -> pa.Table | None:
    """Return the rows of an open episode that reached the disk; None if there are none.

    Raises:
        UnsafePathError: their file is elsewhere, or not a file.
    """
    batches = []
    path = file_inside(open_folder(folder), ROWS, "the rows of the open episode")
    try:
        with path.open("rb") as file, pa.ipc.open_stream(file) as stream:
            with contextlib.suppress(pa.ArrowException, OSError):  # the last batch is truncated
                batches.extend(stream)
            return pa.Table.from_batches(batches, stream.schema) if batches else None
    except (OSError, pa.ArrowException):
        return None


def columns_of(table: pa.Table) -> dict[str, Any]:
    """Return the columns of a table as arrays, (N,) or (N, D)."""
    return {name: array_of(table.column(name)) for name in table.column_names}

"""The open episode on the disk, as streams: a kill loses at most half a second, a power cut two seconds.

Its files are flushed to the operating system every half second, and to the disk every second.
"""

from __future__ import annotations

import errno
import json
import os
import shutil
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from joshua.api.files import file_inside, inside, is_system_error, safe_name
from joshua.features import DatasetLayout, EpisodeError
from joshua.tools import parse_json

from joshua_dataset.files import Files, aside_folder, reason
from joshua_dataset.lock import PRIVATE
from joshua_dataset.metadata import STAMP, array_of, column_of
from joshua_dataset.pictures import ERRORS, FRAGMENT_S, QUEUE_S, Encoder, PictureFiles, Video
from joshua_dataset.statistics import Statistics

ROWS = "rows.arrows"
JOURNAL = "episode.json"
SUFFIXES = {"video": ".mp4", "png": "", "jpeg": ""}

#: Interval at which the open episode is flushed to the disk, s. With the fragment that waits, and the time
#: that the disk takes, a power cut loses at most 2 s.
SYNC_S = 1.0


def open_folder(folder: Path) -> Path:
    """Return the folder of a data set's open episode. Raises UnsafePathError for one elsewhere."""
    return inside(folder, Path(PRIVATE) / "open", "the open episode")


def begin(folder: Path, number: int, journal: Mapping[str, Any], files: Files) -> Path:
    """Make the folder of an episode, with its journal; return it.

    Args:
        folder: of the data set; number: of the episode; journal: what a repair needs to complete it.

    Raises:
        OSError: writing fails.
    """
    place = open_folder(folder)
    if os.path.lexists(place):  # nothing counts it, but it may contain what was recorded
        files.move_aside(place, aside_folder(folder), aside_name(number))
    files.make_folder(place)
    text = json.dumps({"episode_index": number, **journal})
    files.write(place / JOURNAL, text.encode())
    return place


def aside_name(number: int) -> str:
    """Return the name of what is left of an episode that could not be mended."""
    return f"episode-{max(number, 0):06d}-{time.strftime('%Y%m%d-%H%M%S')}"


class Syncer:
    """Thread that brings files to the disk while they are written.

    Args:
        sync: flushes what is new; called every ``SYNC_S``.

    Attributes:
        error: of the disk, after which the thread has ended.
    """

    def __init__(self, sync: Callable[[], None]) -> None:
        self._sync = sync
        self.error: OSError | None = None
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, name="sync", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread. Idempotent."""
        self._end.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._end.wait(SYNC_S):
            try:
                self._sync()
            except OSError as error:
                self.error = error
                return


class OpenEpisode:
    """Files of one episode, invisible to readers of the data set.

    After an error the episode takes no more frames, and what it has stays on the disk.

    Args:
        layout: of the data set; schema: of the rows: numbers of the features and stamps.
        number: of the episode; journal: what a repair needs to complete it.
        files: file operations.

    Attributes:
        frames: that were added; has_failed: whether an error has ended it.

    Raises:
        OSError, av.FFmpegError: writing fails. The methods raise them, too.
    """

    def __init__(
        self,
        layout: DatasetLayout,
        schema: pa.Schema,
        number: int,
        journal: Mapping[str, Any],
        files: Files | None = None,
    ) -> None:
        self._layout, self._schema = layout, schema
        self._files = files or Files()
        self.encoders: dict[str, Encoder] = {}
        self.frames = 0
        self.has_failed = False
        self._rows: list[dict[str, Any]] = []
        self._flush_every = max(1, round(layout.fps * FRAGMENT_S / 2))
        self._written = 0
        self._rows_file = -1
        self._syncer: Syncer | None = None
        self.folder = begin(layout.folder, number, journal, self._files)
        try:
            self._rows_file = os.open(self.folder / ROWS, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o666)
            self._append(schema.serialize())
            for feature in layout.features.pictures:
                self.encoders[feature.key] = self._encoder(feature.key, *feature.shape[:2])
        except BaseException:
            self.drop()  # it has no frame
            raise
        self._syncer = Syncer(self.sync)

    def add(self, stamp_ns: int, values: Mapping[str, Any]) -> None:
        """Add a frame of checked values."""
        try:
            self._check_disk()
            for key, encoder in self.encoders.items():
                encoder.add(values[key])
            self._rows.append(
                {STAMP: stamp_ns}
                | {key: values[key] for key in self._layout.features if key not in self.encoders}
            )
            self.frames += 1
            if len(self._rows) >= self._flush_every:
                self._flush()
        except BaseException:
            self.has_failed = True
            raise

    def finish(self) -> tuple[dict[str, Any], dict[str, Statistics]]:
        """Complete all files; return the columns, (N, …) each, and the statistics of the pictures.

        After an error of the disk, call it again when the cause is removed: no frame that was added is lost.
        """
        self._end()
        try:
            found, errors = {}, []
            for key, encoder in self.encoders.items():
                try:
                    found[key] = encoder.finish()
                except ERRORS as error:  # the others are completed all the same
                    errors.append(error)
            self._flush()
            if errors:
                raise errors[0]
            rows, _ = whole_rows(self.folder)
            if rows is None or len(rows) != self.frames:
                raise OSError(errno.EIO, "the rows cannot be read back", str(self.folder / ROWS))
        except BaseException:
            self.has_failed = True
            raise
        self._close()
        return columns_of(rows), found

    def sync(self) -> None:
        """Bring what is written to the disk. Raises OSError."""
        self._files.sync(self.folder / ROWS)
        for encoder in self.encoders.values():
            for path in encoder.target.unsynced():
                if path.is_dir():
                    self._files.sync_folder(path)
                elif path.exists():
                    self._files.sync(path)
        self._files.sync_folder(self.folder)

    def pictures(self, key: str) -> Path:
        """Return the file or folder of the pictures of a feature."""
        return pictures_path(self._layout, key)

    def drop(self) -> None:
        """Remove everything, because the user discards it. Idempotent."""
        self._end()
        for encoder in self.encoders.values():
            encoder.drop()
        self._close()
        remove(self._layout.folder)

    def _check_disk(self) -> None:
        """Raise the error of the disk or a codec after which the episode cannot go on."""
        errors = [encoder.error for encoder in self.encoders.values()]
        if self._syncer is not None:
            errors.append(self._syncer.error)
        for error in errors:
            if error is not None:
                raise error

    def _end(self) -> None:
        if self._syncer is not None:
            self._syncer.stop()

    def _close(self) -> None:
        descriptor, self._rows_file = self._rows_file, -1
        if descriptor >= 0:
            os.close(descriptor)

    def _encoder(self, key: str, height: int, width: int) -> Encoder:
        path, kind = self.pictures(key), self._layout.pictures
        target = (
            Video(path, width, height, self._layout.fps, self._layout.codec)
            if kind == "video"
            else PictureFiles(path, ".png" if kind == "png" else ".jpg")
        )
        return Encoder(target, key, round(QUEUE_S * self._layout.fps))

    def _flush(self) -> None:
        if not self._rows or self._rows_file < 0:
            return
        arrays = [
            column_of(np.asarray([row[field.name] for row in self._rows]), field.type)
            for field in self._schema
        ]
        self._append(pa.record_batch(arrays, schema=self._schema).serialize())
        self._rows.clear()

    def _append(self, message: pa.Buffer) -> None:
        """Append a message of Arrow's stream format; one that was written in part is overwritten."""
        left = memoryview(message)
        position = self._written
        while left:
            count = os.pwrite(self._rows_file, left, position)
            position += count
            left = left[count:]
        self._written = position


def pictures_path(layout: DatasetLayout, key: str) -> Path:
    """Return the file or folder of the pictures of a feature in the open episode. Raises UnsafePathError."""
    name = f"{safe_name(key, 'the feature')}{SUFFIXES[layout.pictures]}"
    return inside(open_folder(layout.folder), name, "the pictures")


def remove(folder: Path) -> None:
    """Remove the open episode of a data set, which was discarded or is kept.

    Raises:
        UnsafePathError: it is elsewhere.
    """
    shutil.rmtree(open_folder(folder), ignore_errors=True)


def read_journal(folder: Path) -> dict[str, Any] | None:
    """Return the journal of an open episode; None if there is none, {} if it is not valid.

    Raises:
        EpisodeError: the system does not let it be read, or it is elsewhere, or not a file.
    """
    try:
        path = file_inside(folder, open_folder(folder) / JOURNAL, "the description of the open episode")
        record = parse_json(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {} if open_folder(folder).exists() else None
    except OSError as error:
        place = folder / PRIVATE / "open"
        raise EpisodeError(
            f"{place / JOURNAL} cannot be read: {reason(error)}. The unfinished episode stays in {place}"
        ) from error
    except ValueError:
        return {}
    return record if isinstance(record, dict) and isinstance(record.get("episode_index"), int) else {}


def whole_rows(folder: Path) -> tuple[pa.Table | None, bool]:
    """Return the rows of an open episode that reached the disk, and whether the file is damaged.

    Only the last batch of a file can be torn.

    Args:
        folder: of the open episode.

    Raises:
        OSError: the system does not let the file be read, or it is elsewhere, or not a file.
    """
    path = file_inside(folder, ROWS, "the rows of the open episode")
    batches: list[pa.RecordBatch] = []
    largest = end = 0
    schema = None
    try:
        size = path.stat().st_size
        with path.open("rb") as file, pa.ipc.open_stream(file) as stream:
            schema, end = stream.schema, file.tell()
            for batch in stream:
                batches.append(batch)
                largest, end = max(largest, file.tell() - end), file.tell()
    except FileNotFoundError:
        return None, False
    except pa.ArrowException:
        pass  # the batches before are whole
    except OSError as error:  # pyarrow's own, of a torn batch, has no number
        if is_system_error(error):
            raise
    is_damaged = size - end > max(2 * largest, 1 << 16)
    return (pa.Table.from_batches(batches, schema) if batches else None), is_damaged


def columns_of(table: pa.Table) -> dict[str, Any]:
    """Return the columns of a table as arrays, (N,) or (N, D)."""
    return {name: array_of(table.column(name)) for name in table.column_names}

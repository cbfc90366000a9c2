"""Durable file operations: after a power cut, a change of a data set is either complete or absent."""

from __future__ import annotations

import contextlib
import errno
import json
import os
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq
from joshua.api.files import inside

#: What to do about an error of the disk.
_REMEDIES = {
    errno.EROFS: "The disk is read-only: `dmesg` says why. Mount it again, or name another local_path",
    errno.ENOSPC: "Free some space, or name another local_path",
    errno.EIO: "Check the disk and its cable",
    errno.ENODEV: "Check the disk and its cable",
}


def reason(error: Exception) -> str:
    """Return the text of an error, with what to do about the disk."""
    remedy = _REMEDIES.get(getattr(error, "errno", None) or 0)
    return f"{error}. {remedy}" if remedy else str(error)


class Files:
    """The operations whose order decides what a power cut leaves behind."""

    def sync(self, path: Path) -> None:
        """Flush the content of a file to the disk. Raises OSError."""
        self._sync(path, os.O_RDONLY)

    def sync_folder(self, folder: Path) -> None:
        """Flush the names in a folder to the disk. Raises OSError."""
        self._sync(folder, os.O_RDONLY | os.O_DIRECTORY)

    def replace(self, source: Path, target: Path) -> None:
        """Move a file into place. Raises OSError."""
        source.replace(target)

    def make_folder(self, folder: Path) -> None:
        """Create a folder and its parents, and flush their names. Raises OSError."""
        if folder.is_dir():
            return
        if folder.exists():
            raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(folder))
        self.make_folder(folder.parent)
        folder.mkdir(exist_ok=True)
        self.sync_folder(folder.parent)

    @staticmethod
    def _sync(path: Path, flags: int) -> None:
        descriptor = os.open(path, flags)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


class Staging:
    """The files of one change of a data set; readers see none of them before ``commit``.

    Args:
        files: file operations; folder: of the data set, which contains every path.
    """

    def __init__(self, files: Files, folder: Path) -> None:
        self._files, self._folder = files, folder
        self._staged: list[tuple[Path, Path]] = []
        self._moved: list[tuple[Path, Path]] = []

    def table(self, path: Path, table: pa.Table) -> None:
        """Write a table in the format that the suffix names: ``.parquet``, ``.csv`` or ``.jsonl``.

        Raises:
            OSError, pyarrow.ArrowException: writing fails.
        """
        fresh = self._fresh(path)
        if path.suffix == ".csv":
            pa_csv.write_csv(table, fresh)
        elif path.suffix == ".jsonl":
            with fresh.open("w", encoding="utf-8") as file:
                for batch in table.to_batches(max_chunksize=1000):
                    file.writelines(json.dumps(row) + "\n" for row in batch.to_pylist())
        else:
            pq.write_table(table, fresh, compression="snappy")

    def json(self, path: Path, value: Any) -> None:
        """Write a value as JSON. Raises OSError."""
        self._fresh(path).write_text(json.dumps(value, indent=4) + "\n", encoding="utf-8")

    def move(self, source: Path, path: Path) -> None:
        """Add a complete file or folder from the same disk. Raises OSError."""
        inside(self._folder, source)
        self._files.make_folder(inside(self._folder, path).parent)
        self._moved.append((source, path))

    def commit(self) -> None:
        """Move everything into place; the last file written follows when all others are safe on the disk.

        Raises:
            OSError: moving fails.
        """
        for fresh, _ in self._staged:
            self._files.sync(fresh)
        for source, _ in self._moved:
            for path in source.rglob("*") if source.is_dir() else (source,):
                self._files.sync(path)
            if source.is_dir():
                self._files.sync_folder(source)
        *first, last = [*self._moved, *self._staged]
        for source, path in first:
            self._files.replace(source, path)
        for folder in {path.parent for _, path in first}:
            self._files.sync_folder(folder)
        self._files.replace(*last)
        self._files.sync_folder(last[1].parent)

    def discard(self) -> None:
        """Remove written files that are not in place."""
        for fresh, _ in self._staged:
            with contextlib.suppress(OSError):
                fresh.unlink(missing_ok=True)

    def _fresh(self, path: Path) -> Path:
        self._files.make_folder(inside(self._folder, path).parent)
        fresh = inside(self._folder, path.with_suffix(".new"))
        self._staged.append((fresh, path))
        return fresh

"""Files that are written beside their places and put there together, once all of them are whole."""

from __future__ import annotations

import contextlib
import json
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq


class Staging:
    """The files of one change of a data set; readers see none of them before ``commit``."""

    def __init__(self) -> None:
        self._files: list[tuple[Path, Path]] = []

    def table(self, path: Path, table: pa.Table) -> None:
        """Writes a table. Raises OSError and pyarrow.ArrowException."""
        pq.write_table(table, self._fresh(path), compression="snappy")

    def json(self, path: Path, value: Any) -> None:
        """Writes a value. Raises OSError."""
        self._fresh(path).write_text(json.dumps(value, indent=4) + "\n", encoding="utf-8")

    def commit(self) -> None:
        """Puts the files in their places, in the order of writing. Raises OSError."""
        for fresh, path in self._files:
            fresh.replace(path)

    def discard(self) -> None:
        """Removes what is not in its place."""
        for fresh, _ in self._files:
            with contextlib.suppress(OSError):
                fresh.unlink(missing_ok=True)

    def _fresh(self, path: Path) -> Path:
        path.parent.mkdir(parents=True, exist_ok=True)
        fresh = path.with_suffix(".new")
        self._files.append((fresh, path))
        return fresh

"""Rows of metrics of a run that goes on. Without Ray."""

from __future__ import annotations

import contextlib
import json
import os
from pathlib import Path
from typing import Any


class Rows:
    """Reads ``metrics.jsonl`` while a run appends to it, or cuts it to compute the last rows again."""

    def __init__(self) -> None:
        self._inode = self._read = 0
        self._last = self._known = -1  # steps: of the newest row, and of those before the file was cut

    def next(self, path: Path) -> dict[str, Any] | None:
        """Return the next complete row, each of some steps once; None if there is none yet."""
        with contextlib.suppress(FileNotFoundError), path.open("rb") as file:
            found = os.fstat(file.fileno())
            if found.st_ino != self._inode or found.st_size < self._read:
                self._inode, self._read, self._known = found.st_ino, 0, self._last
            file.seek(self._read)
            for line in file:
                if not line.endswith(b"\n"):
                    break
                self._read += len(line)
                row: dict[str, Any] = json.loads(line)
                if row["steps"] > self._known:
                    self._last = max(self._last, row["steps"])
                    return row
        return None

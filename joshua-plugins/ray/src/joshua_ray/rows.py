"""Rows of metrics of a run that goes on. Without Ray."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from joshua.tools import parse_json


class Rows:
    """Reads ``metrics.jsonl`` while a run appends to it, or cuts it to compute the last rows again.

    Attributes:
        names: figures of the rows so far.
    """

    def __init__(self) -> None:
        self.names: set[str] = set()
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
                row: dict[str, Any] = parse_json(line)
                self.names |= {name for name, value in row.items() if isinstance(value, (int, float))}
                if row["steps"] > self._known:
                    self._last = max(self._last, row["steps"])
                    return row
        return None

    def lacking(self, metric: str, complete: Sequence[str] = ()) -> str:
        """Return why a run cannot be judged by a metric; "" if it can, or if the metric may still come.

        Args:
            complete: beginnings of names; a run whose rows have one of each has written all of its figures.
        """
        are_all = all(any(name.startswith(begin) for name in self.names) for begin in complete)
        if metric in self.names or not are_all:
            return ""
        from joshua.tools import nearest_first

        known = ", ".join(nearest_first(metric, sorted(self.names - {"steps"})))
        return f"its metrics have no {metric}" + (f": choose --metric from {known}" if known else "")

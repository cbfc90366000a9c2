"""Unfinished uploads of large files, kept so that they resume after a kill."""

from __future__ import annotations

import contextlib
import json
import os
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Any

from joshua.api.files import file_inside, inside
from joshua.tools import parse_json

from joshua_dataset.lock import PRIVATE

if TYPE_CHECKING:
    from joshua_dataset.cloud.store import Outgoing

NAME = "uploads.json"


class Sessions:
    """Replies of remotes to the start of an upload, kept in the private folder of a data set.

    Such a reply contains addresses that accept the content of one file without credentials, for some days.
    So only the owner can read it, and it is deleted when the file has arrived.

    Args:
        folder: of the data set; None keeps nothing.
        remote: address of the copy.
    """

    def __init__(self, folder: Path | None = None, remote: str = "") -> None:
        self._folder = folder
        self._path = folder / PRIVATE / NAME if folder is not None else None
        self._remote = remote
        self._lock = threading.Lock()
        self._records: dict[str, dict[str, Any]] = {}
        with contextlib.suppress(OSError, ValueError, TypeError):
            if folder is not None and self._path is not None:
                file_inside(folder, self._path)
                records = dict(parse_json(self._path.read_text(encoding="utf-8")))
                self._records = {key: dict(value) for key, value in records.items()}

    def get(self, item: Outgoing) -> dict[str, Any]:
        """Return the record of this upload; empty if there is none."""
        with self._lock:
            found = self._records.get(self._key(item), {})
        return found if found.get("sha256") == item.digest.sha256 else {}

    def put(self, item: Outgoing, record: dict[str, Any]) -> None:
        """Store the record of an upload."""
        with self._lock:
            self._records[self._key(item)] = {**record, "sha256": item.digest.sha256}
            self._write()

    def forget(self, item: Outgoing) -> None:
        """Delete the record of an upload that has ended or cannot continue."""
        with self._lock:
            if self._records.pop(self._key(item), None) is not None:
                self._write()

    def _key(self, item: Outgoing) -> str:
        return f"{self._remote}/{item.name}"

    def _write(self) -> None:
        """Write the records; if the folder is not writable, a killed upload starts again."""
        if self._folder is None or self._path is None:
            return
        with contextlib.suppress(OSError):
            inside(self._folder, self._path)
            if not self._records:
                self._path.unlink(missing_ok=True)
                return
            self._path.parent.mkdir(exist_ok=True)
            fresh = self._path.with_suffix(".new")
            fresh.unlink(missing_ok=True)
            descriptor = os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
            with os.fdopen(descriptor, "w", encoding="utf-8") as file:
                json.dump(self._records, file)
            fresh.replace(self._path)

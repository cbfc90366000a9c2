"""Lock that allows one writer per data set, names its owner and ends with the owner's process."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import socket
import time
from pathlib import Path
from typing import Any

from joshua.api.files import file_inside
from joshua.features import EpisodeError

#: Folder of the writer's own files inside a data set; readers of LeRobot's layout ignore it.
PRIVATE = ".joshua"


class WriterLock:
    """Lock against a second writer of a data set.

    Args:
        folder: of the data set.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._path = folder / PRIVATE / "lock"
        self._file: Any = None

    def take(self) -> None:
        """Take the lock. Raises EpisodeError that names the owner, and OSError."""
        file_inside(self._folder, self._path, "the lock")
        self._path.parent.mkdir(parents=True, exist_ok=True)
        while True:
            file = self._path.open("a+", encoding="utf-8")
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                file.seek(0)
                text = file.read()
                file.close()
                raise self._taken(text) from None
            except OSError:
                file.close()
                raise
            # the previous owner may have removed the file that was locked here
            if self._path.exists() and os.path.samestat(os.fstat(file.fileno()), self._path.stat()):
                break
            file.close()
        self._file = file
        file.truncate(0)
        started = time.strftime("%Y-%m-%d %H:%M:%S")
        json.dump({"process": os.getpid(), "host": socket.gethostname(), "since": started}, file)
        file.flush()

    def require_free(self) -> None:
        """Check that no other process writes, without a change.

        Raises:
            EpisodeError: another process writes; the message names it.
            UnsafePathError: the lock is elsewhere, or not a file.
        """
        file_inside(self._folder, self._path, "the lock")
        with contextlib.suppress(OSError), self._path.open(encoding="utf-8") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
            except BlockingIOError:
                raise self._taken(file.read()) from None

    def release(self) -> None:
        """Release the lock. Idempotent."""
        if self._file is not None:
            with contextlib.suppress(OSError):  # the disk may be disconnected
                self._path.unlink(missing_ok=True)
                self._path.parent.rmdir()
            self._file.close()
            self._file = None

    def _taken(self, text: str) -> EpisodeError:
        return EpisodeError(
            f"{self._folder} is being written by {_owner(text)}. "
            "Stop that recording, or name another local_path"
        )


def _owner(text: str) -> str:
    try:
        record = json.loads(text)
        return f"process {record['process']} on {record['host']} since {record['since']}"
    except (ValueError, KeyError, TypeError):
        return "another process"

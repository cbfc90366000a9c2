"""The log of a run in its folder: what its node logs, its warnings, and how it ended."""

from __future__ import annotations

import logging
from contextlib import suppress
from typing import TextIO

from joshua.api.texts import printable

from joshua_training.run_folder import RunFolder, unwritable

#: File in the folder of a run.
LOG = "run.log"


class RunLog(logging.Handler):
    """Appends the records of a node to ``run.log``; those from before the run has a folder, too.

    Args:
        log: of the node, until ``close``.
    """

    def __init__(self, log: logging.Logger) -> None:
        super().__init__(logging.INFO)
        self.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(message)s", "%Y-%m-%dT%H:%M:%S%z"))
        self._log = log
        self._early: list[logging.LogRecord] = []
        self._file: TextIO | None = None
        log.addHandler(self)

    def open(self, folder: RunFolder) -> None:
        """Write from now on. Raises RunError."""
        path = folder.path / LOG
        self.acquire()
        try:
            self._file = path.open("a", encoding="utf-8")
            early, self._early = self._early, []
            for record in early:
                self.emit(record)
        except OSError as error:
            raise unwritable(path, error) from error
        finally:
            self.release()

    def emit(self, record: logging.LogRecord) -> None:
        """Write a record. A full disk ends the training at its next checkpoint, not here."""
        if self._file is None:
            self._early.append(record)
            return
        with suppress(OSError, TypeError, ValueError):  # of a wrong format string, too
            self._file.write(f"{printable(self.format(record))}\n")
            self._file.flush()

    def note(self, level: int, text: str, error: BaseException | None = None) -> None:
        """Write a line that is reported otherwise; with the stack of ``error``."""
        cause = (type(error), error, error.__traceback__) if error is not None else None
        self.handle(logging.LogRecord(self._log.name, level, "", 0, "%s", (text,), cause))

    def close(self) -> None:
        """Take no more records. Idempotent."""
        self._log.removeHandler(self)
        self.acquire()
        try:
            file, self._file = self._file, None
            if file is not None:
                with suppress(OSError):
                    file.close()
        finally:
            self.release()
        super().close()

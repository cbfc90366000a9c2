"""Metrics for TensorBoard, in its own format, without PyTorch."""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any


class Board:
    """Writer of event files. Each row is on the disk when it is added, and a full disk is an error there.

    Args:
        folder: for them; continued: steps after which older files are superseded, 0 for a new run.

    Raises:
        ImportError: TensorBoard is not installed.
        OSError: the file cannot be written.
    """

    def __init__(self, folder: Path, continued: int = 0) -> None:
        from tensorboard.compat.proto.event_pb2 import Event, SessionLog
        from tensorboard.compat.proto.summary_pb2 import Summary
        from tensorboard.summary.writer.record_writer import RecordWriter

        self._event, self._summary = Event, Summary
        folder.mkdir(parents=True, exist_ok=True)
        # TensorBoard reads the files in the order of their names
        name = f"events.out.tfevents.{time.time():.6f}.{socket.gethostname()}.{os.getpid()}"
        self._file = (folder / name).open("wb")
        self._records: Any = RecordWriter(self._file)
        self._add(Event(wall_time=time.time(), file_version="brain.Event:2"))
        self._restart = SessionLog(status=SessionLog.START)
        if continued:
            self.rewind(continued)

    def add(self, row: Mapping[str, float], steps: int) -> None:
        """Add the metrics of a row whose names have a group, as in ``loss/train``. Raises OSError."""
        values = [
            self._summary.Value(tag=name, simple_value=value) for name, value in row.items() if "/" in name
        ]
        self._add(self._event(wall_time=time.time(), step=steps, summary=self._summary(value=values)))

    def rewind(self, steps: int) -> None:
        """Supersede what came after some steps. Raises OSError."""
        self._add(self._event(wall_time=time.time(), step=steps + 1, session_log=self._restart))

    def close(self) -> None:
        """Close the file. Idempotent."""
        try:
            self._file.close()
        except OSError:  # what is left of a row that could not be written
            return

    def _add(self, event: Any) -> None:
        self._records.write(event.SerializeToString())
        self._file.flush()

"""Metrics for TensorBoard, written by its own library, without PyTorch."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any


class Board:
    """Writer of event files.

    Args:
        folder: for them; continued: steps after which older files are superseded, 0 for a new run.

    Raises:
        ImportError: TensorBoard is not installed.
    """

    def __init__(self, folder: Path, continued: int = 0) -> None:
        from tensorboard.compat.proto.event_pb2 import Event, SessionLog
        from tensorboard.compat.proto.summary_pb2 import Summary
        from tensorboard.summary.writer.event_file_writer import EventFileWriter

        self._event, self._summary = Event, Summary
        self._writer: Any = EventFileWriter(str(folder))
        if continued:
            log = SessionLog(status=SessionLog.START)
            self._writer.add_event(Event(wall_time=time.time(), step=continued + 1, session_log=log))

    def add(self, row: Mapping[str, float], steps: int) -> None:
        """Add the metrics of a row whose names have a group, as in ``loss/train``."""
        values = [
            self._summary.Value(tag=name, simple_value=value) for name, value in row.items() if "/" in name
        ]
        self._writer.add_event(
            self._event(wall_time=time.time(), step=steps, summary=self._summary(value=values))
        )

    def close(self) -> None:
        """Write what is left."""
        self._writer.close()

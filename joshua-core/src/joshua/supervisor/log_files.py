"""The log of a run: JSON lines, rotated by size, written on a thread that a slow disk may block."""

from __future__ import annotations

import glob
import os
import re
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Generic, TypeVar

from joshua.ipc.run_bases import state_home
from joshua.plan.private_files import make_private, private_opener

_T = TypeVar("_T")

#: Pending lines beyond which the newest are dropped and counted.
MAX_WAITING = 5000


class BackgroundWriter(Generic[_T]):
    """Passes lines of any type to a function on one thread, in order.

    Args:
        write: called with each batch of lines. An exception ends the writer.
        name: of the thread.

    Attributes:
        dropped: lines that found the queue full.
    """

    def __init__(self, write: Callable[[list[_T]], None], name: str) -> None:
        self._write = write
        self._lines: deque[_T] = deque()
        self._condition = threading.Condition()
        self._closing = False
        self.dropped = 0
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._started = False

    def put(self, line: _T) -> None:
        """Queues a line without blocking."""
        with self._condition:
            if self._closing or len(self._lines) >= MAX_WAITING:
                self.dropped += 1
                return
            self._lines.append(line)
            if not self._started:
                self._started = True
                self._thread.start()
            self._condition.notify()

    def close(self, timeout_s: float) -> bool:
        """Writes pending lines and returns whether that was done in time."""
        with self._condition:
            self._closing = True
            self._condition.notify()
        if self._started:
            self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _run(self) -> None:
        while True:
            with self._condition:
                while not self._lines and not self._closing:
                    self._condition.wait()
                if not self._lines:
                    return
                batch = list(self._lines)
                self._lines.clear()
            self._write(batch)


#: Size at which a file is rotated.
MAX_FILE_BYTES = 10 * 1024 * 1024

#: Rotated files kept of one run.
KEPT_ROTATIONS = 3

#: Names of the logs of runs: robot, date, time and process. No other file is ever removed.
_NAME = re.compile(r".+-\d{8}-\d{6}-\d+\.jsonl")

#: Runs whose logs are kept.
KEPT_RUNS = 20

#: Pause before the next attempt after a write has failed.
RETRY_S = 10.0

CLOSE_TIMEOUT_S = 1.0


def log_directory(environment: Mapping[str, str]) -> Path:
    """Folder of the logs: ``JOSHUA_LOG_DIR``, or ``log`` in the state folder."""
    if environment.get("JOSHUA_LOG_DIR"):
        return Path(environment["JOSHUA_LOG_DIR"])
    return state_home(environment) / "log"


class LogFile:
    """One run's log file.

    Args:
        path: the file. Its folder is created with the first line.
        warn: called once, on the writer's thread, if the file cannot be written.
        max_file_bytes: size at which the file is rotated.
    """

    def __init__(self, path: Path, warn: Callable[[str], None], max_file_bytes: int = MAX_FILE_BYTES) -> None:
        self.path = path
        self._warn = warn
        self._warned = False
        self._max_file_bytes = max_file_bytes
        self._lost = 0
        self._retry_s = 0.0
        self._writer = BackgroundWriter[str](self._write, "log-file")

    def put(self, line: str) -> None:
        """Queues one line, without its line end, without blocking."""
        self._writer.put(line)

    def close(self) -> None:
        """Writes pending lines. Gives up after a second."""
        self._writer.close(CLOSE_TIMEOUT_S)

    def _write(self, lines: list[str]) -> None:
        if time.monotonic() < self._retry_s:
            self._lost += len(lines)
            return
        data = deque(line.encode("utf-8", "backslashreplace") + b"\n" for line in lines)
        if self._lost:
            lost = f'{{"level": "WARNING", "text": "{self._lost} lines could not be written here"}}\n'
            data.appendleft(b"\n" + lost.encode())
        try:
            self._append(data)
            self._lost = 0
        except OSError as error:
            self._lost += len(lines)
            self._retry_s = time.monotonic() + RETRY_S
            if not self._warned:
                self._warned = True
                self._warn(
                    f"the log file {self.path} cannot be written: {error.strerror or error}. The run goes on "
                    "without it. Free space there, or set JOSHUA_LOG_DIR to another folder"
                )

    def _append(self, data: deque[bytes]) -> None:
        make_private(self.path.parent)
        while data:
            with open(self.path, "ab", opener=private_opener) as file:
                while data and (file.tell() == 0 or file.tell() + len(data[0]) <= self._max_file_bytes):
                    file.write(data.popleft())
            if data:
                names = [self.path, *(Path(f"{self.path}.{n}") for n in range(1, KEPT_ROTATIONS + 1))]
                for older, newer in zip(names[:0:-1], names[-2::-1], strict=True):
                    if newer.exists():
                        newer.replace(older)


def new_log(folder: Path, robot: str) -> Path:
    """Path of the log of a new run."""
    return folder / f"{robot or 'robot'}-{time.strftime('%Y%m%d-%H%M%S')}-{os.getpid()}.jsonl"


def remove_old_logs(folder: Path, keep: int = KEPT_RUNS) -> None:
    """Removes the logs of all but the newest runs, as far as possible."""
    try:
        ours = [path for path in folder.glob("*.jsonl") if _NAME.fullmatch(path.name)]
        logs = sorted(ours, key=lambda path: path.stat().st_mtime, reverse=True)
        for log in logs[keep:]:
            for path in folder.glob(f"{glob.escape(log.stem)}[.-]*"):  # rotations, and pictures of a test
                path.unlink()
    except OSError:
        return  # another run cleans up at the same time, or the folder is not ours to change

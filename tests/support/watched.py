"""The output of a program that runs on, read while it comes."""

from __future__ import annotations

import subprocess
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import IO


class Watched:
    """Collects what a process prints; its standard error goes to the same pipe."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        assert process.stdout is not None
        self.process = process
        self._text = ""
        self._changed = threading.Condition()
        self._reader = threading.Thread(target=self._read, args=(process.stdout,), daemon=True)
        self._reader.start()

    @property
    def text(self) -> str:
        """Everything so far."""
        with self._changed:
            return self._text

    def wait(self, text: str, timeout_s: float = 60.0) -> None:
        """Waits until a text has come; fails with everything that was printed."""
        deadline_s = time.monotonic() + timeout_s
        with self._changed:
            while text not in self._text:
                left_s = deadline_s - time.monotonic()
                ended = self.process.poll() is not None and not self._reader.is_alive()
                assert left_s > 0, f"{text!r} did not come:\n{self._text}"
                assert not ended, f"{text!r} did not come, exit code {self.process.returncode}:\n{self._text}"
                self._changed.wait(min(left_s, 0.2))

    def end(self, timeout_s: float = 60.0) -> tuple[int, str]:
        """Waits for the end; exit code and everything that was printed."""
        self.process.wait(timeout_s)
        self._reader.join(timeout_s)
        return self.process.returncode, self.text

    def _read(self, stream: IO[str]) -> None:
        for line in stream:
            with self._changed:
                self._text += line
                self._changed.notify_all()


@contextmanager
def watched_run(command: Sequence[str], environment: Mapping[str, str]) -> Iterator[Watched]:
    """Runs a program and watches what it prints; kills it in the end if it still runs."""
    process = subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=environment,
    )
    watched = Watched(process)
    try:
        yield watched
    finally:
        process.kill()
        watched.end()
        assert process.stdout is not None
        process.stdout.close()

"""Interface of a remote: list its files, receive and verify one, return one."""

from __future__ import annotations

import hashlib
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from joshua_dataset.cloud.address import Address
from joshua_dataset.cloud.errors import RemoteError, StoppedError
from joshua_dataset.cloud.ledger import Digest
from joshua_dataset.cloud.sessions import Sessions

Result = TypeVar("Result")

#: Bytes that are read or sent at once.
CHUNK = 4 << 20

#: Number of attempts at a file whose checksum is wrong.
ATTEMPTS = 3

#: Longest wait between two attempts, and time without a byte after which a transfer fails.
LONGEST_WAIT_S = 15.0
PATIENCE_S = 60.0

#: Time between two reports of progress.
REPORT_PERIOD_S = 0.2


@dataclass(frozen=True)
class RemoteFile:
    """A file of a remote data set.

    Attributes:
        name: within the data set, with ``/``; size: bytes.
        checksums: by their kind: ``sha256``, ``md5``, ``blob`` (git's), ``etag`` (of an upload in parts).
        state: changes when the file does; "" if the remote does not report it.
    """

    name: str
    size: int
    checksums: tuple[tuple[str, str], ...] = ()
    state: str = ""


@dataclass(frozen=True)
class Outgoing:
    """A file to send to a remote.

    Attributes:
        name: at the remote; path: on this machine; digest: of its content.
    """

    name: str
    path: Path
    digest: Digest


class Tally:
    """Progress of a transfer, shared by all its threads.

    Args:
        show: called with the progress, at most five times a second.
        stopping: whether the transfer has to end.
        note: called with the error of a failed attempt that is repeated.
        patience_s: time without a byte after which a network fault ends the transfer.

    Attributes:
        files, bytes: of the whole transfer; done_files, done_bytes: complete at the target.
        moved_bytes, moved_files: moved by this transfer itself.
    """

    def __init__(
        self,
        show: Callable[[Tally], None] = lambda tally: None,
        stopping: Callable[[], bool] = lambda: False,
        note: Callable[[str], None] = lambda text: None,
        patience_s: float = PATIENCE_S,
    ) -> None:
        self._show, self._stopping, self._note = show, stopping, note
        self._patience_s = patience_s
        self._lock = threading.Lock()
        self._moved_s = self._began_s = time.monotonic()
        self._shown_s = 0.0
        self.files = self.done_files = self.moved_files = 0
        self.bytes = self.done_bytes = self.moved_bytes = 0

    @property
    def elapsed_s(self) -> float:
        """Time since the start."""
        return time.monotonic() - self._began_s

    @property
    def rate(self) -> float:
        """Bytes per second."""
        return self.moved_bytes / max(1e-3, self.elapsed_s)

    @property
    def remaining_s(self) -> float | None:
        """Estimated time to completion; None until a byte has moved."""
        return (self.bytes - self.done_bytes) / self.rate if self.moved_bytes else None

    def begin(self, files: int, size: int) -> None:
        """Set the size of the whole transfer."""
        self.files, self.bytes = files, size
        self._moved_s = self._began_s = time.monotonic()
        self._report(force=True)

    def skip(self, size: int) -> None:
        """Count a file that needs no transfer."""
        with self._lock:
            self.done_files += 1
            self.done_bytes += size
        self._report()

    def resume(self, count: int) -> None:
        """Count bytes from an earlier transfer."""
        with self._lock:
            self.done_bytes += count

    def add(self, count: int) -> None:
        """Count moved bytes; negative takes back those of a failed attempt. Raises StoppedError."""
        with self._lock:
            self.done_bytes += count
            self.moved_bytes += count
            if count > 0:
                self._moved_s = time.monotonic()
        self.check()
        self._report()

    def finish(self) -> None:
        """Count a file that has moved and whose checksum is right."""
        with self._lock:
            self.done_files += 1
            self.moved_files += 1
            self._moved_s = time.monotonic()
        self._report(force=self.done_files == self.files)

    def check(self) -> None:
        """Raise StoppedError once the transfer has to end."""
        if self._stopping():
            raise StoppedError("the transfer was stopped")

    def patiently(self, work: Callable[[], Result]) -> Result:
        """Repeat work that fails because of the network, until nothing has moved for too long.

        Raises:
            RemoteError: another error, or the last network error.
        """
        began_s, wait_s = time.monotonic(), 0.5
        while True:
            self.check()
            try:
                return work()
            except RemoteError as error:
                left_s = self._patience_s - (time.monotonic() - max(began_s, self._moved_s))
                if not error.transient or left_s <= 0:
                    raise
                wait_s = min(wait_s, left_s)
                self._note(f"{error}; retrying in {wait_s:.1f} s")
            until_s = time.monotonic() + wait_s
            while time.monotonic() < until_s:
                self.check()
                time.sleep(0.05)
            wait_s = min(2 * wait_s, LONGEST_WAIT_S)

    def _report(self, *, force: bool = False) -> None:
        now_s = time.monotonic()
        if force or now_s - self._shown_s >= REPORT_PERIOD_S:
            self._shown_s = now_s
            self._show(self)


class Store(ABC):
    """Remote location of one data set.

    Attributes:
        keeps_sums: store a file with the checksums of all others beside them.
        sessions: records of unfinished uploads.
    """

    keeps_sums = True

    def __init__(self, address: Address) -> None:
        self.address = address
        self.sessions = Sessions()

    @abstractmethod
    def listing(self) -> dict[str, RemoteFile]:
        """Return the remote files by name; empty if there is no data set. Raises RemoteError."""

    @abstractmethod
    def same(self, there: RemoteFile, path: Path, digest: Digest) -> bool | None:
        """Return whether a local and a remote file are equal; None if the checksums cannot tell."""

    @abstractmethod
    def send(self, files: Sequence[Outgoing], tally: Tally, jobs: int) -> Iterator[RemoteFile]:
        """Send files, verify each by its checksum, and yield the remote files. Raises RemoteError."""

    @abstractmethod
    def chunks(self, there: RemoteFile, start: int) -> Iterator[bytes]:
        """Yield the content of a file from an offset on. Raises RemoteError."""

    @abstractmethod
    def remove(self, names: Sequence[str]) -> None:
        """Remove files. Raises RemoteError."""

    def prepare(self) -> None:
        """Prepare the remote to receive files. Raises RemoteError."""

    def published(self, version: str) -> None:
        """Finish the upload of a complete data set. Raises RemoteError.

        Args:
            version: of its layout.
        """


def read_back(store: Store, there: RemoteFile, tally: Tally) -> str:
    """Read a remote file back and return its SHA-256. Raises RemoteError."""

    def read() -> str:
        found = hashlib.sha256()
        for chunk in store.chunks(there, 0):
            tally.check()
            found.update(chunk)
        return found.hexdigest()

    return tally.patiently(read)


def in_parallel(work: Callable[[Any], Any], items: Sequence[Any], jobs: int) -> Iterator[Any]:
    """Apply a function in several threads, and yield results as they arrive; the first error ends all."""
    waiting = list(reversed(items))
    running: set[Future[Any]] = set()
    with ThreadPoolExecutor(max(1, jobs)) as pool:
        try:
            while waiting or running:
                while waiting and len(running) < jobs:
                    running.add(pool.submit(work, waiting.pop()))
                done, running = wait(running, return_when=FIRST_COMPLETED)
                for future in done:
                    yield future.result()
        finally:
            for future in running:
                future.cancel()

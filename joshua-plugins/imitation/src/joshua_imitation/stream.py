"""Data sets on a remote: numbers are copied at the start, videos are read where a picture is wanted."""

from __future__ import annotations

import io
import threading
from collections import OrderedDict
from collections.abc import Iterator, Sequence
from pathlib import Path

from joshua_dataset.cloud.address import AddressError
from joshua_dataset.cloud.copies import store_of
from joshua_dataset.cloud.download import download
from joshua_dataset.cloud.errors import RemoteError
from joshua_dataset.cloud.ledger import Digest
from joshua_dataset.cloud.store import CHUNK, Outgoing, RemoteFile, Store, Tally
from joshua_training.run_folder import RunError

from joshua_imitation.scratch import Scratch

#: Blocks of videos that are kept in memory.
KEPT = 64


class Stream:
    """A remote data set.

    Args:
        address: such as ``hf://datasets/NAME/DATA``.

    Attributes:
        address: its own; folder: with its metadata and numbers.

    Raises:
        RunError: it cannot be read.
    """

    def __init__(self, address: str) -> None:
        self._blocks: OrderedDict[tuple[str, int], bytes] = OrderedDict()
        self._lock = threading.Lock()
        self.address = address
        self._scratch = Scratch("joshua-stream")
        self.folder = self._scratch.path / "data"  # a copy begins in an empty folder
        self.folder.mkdir()
        try:
            self._store = store_of(address)
            self._there = self._store.listing()
            download(_Numbers(self._store, self._there), self.folder, Tally())
        except (RemoteError, AddressError) as error:
            self.close()
            raise RunError(f"{address} cannot be streamed: {error}") from error

    def opened(self, path: Path) -> io.BufferedIOBase:
        """Open a video of the data set, by its path below ``folder``. Raises RunError."""
        name = path.relative_to(self.folder).as_posix()
        if name not in self._there:
            raise RunError(
                f"{self.address} has no {name}, which its metadata name: upload the data set again"
            )
        return _Video(self, self._there[name])

    def block(self, there: RemoteFile, number: int) -> bytes:
        """Return a block of ``CHUNK`` bytes of a file. Raises RunError."""
        key = (there.name, number)
        with self._lock:
            if (found := self._blocks.get(key)) is not None:
                self._blocks.move_to_end(key)
                return found
        try:
            found = Tally().patiently(lambda: next(iter(self._store.chunks(there, number * CHUNK)), b""))
        except RemoteError as error:
            raise RunError(f"{there.name} cannot be streamed: {error}: continue with resume_run") from error
        with self._lock:
            self._blocks[key] = found
            while len(self._blocks) > KEPT:
                self._blocks.popitem(last=False)
        return found

    def close(self) -> None:
        """Remove the copied numbers."""
        self._scratch.close()


class _Video(io.BufferedIOBase):
    """File object of a remote video."""

    def __init__(self, stream: Stream, there: RemoteFile) -> None:
        self._stream, self._there, self._at = stream, there, 0

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def tell(self) -> int:
        return self._at

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        self._at = offset + {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self._there.size}[whence]
        return self._at

    def read(self, size: int | None = -1) -> bytes:
        left = max(0, self._there.size - self._at)
        wanted = left if size is None or size < 0 else min(size, left)
        parts = []
        while wanted > 0:
            number, offset = divmod(self._at, CHUNK)
            part = self._stream.block(self._there, number)[offset : offset + wanted]
            if not part:
                break
            parts.append(part)
            self._at += len(part)
            wanted -= len(part)
        return b"".join(parts)


class _Numbers(Store):
    """The files of a remote data set but for its videos."""

    def __init__(self, store: Store, there: dict[str, RemoteFile]) -> None:
        super().__init__(store.address)
        self.keeps_sums = store.keeps_sums
        self._store = store
        self._there = {name: item for name, item in there.items() if not name.endswith(".mp4")}

    def listing(self) -> dict[str, RemoteFile]:
        """See ``Store``."""
        return self._there

    def same(self, there: RemoteFile, path: Path, digest: Digest) -> bool | None:
        """See ``Store``."""
        return self._store.same(there, path, digest)

    def chunks(self, there: RemoteFile, start: int) -> Iterator[bytes]:
        """See ``Store``."""
        return self._store.chunks(there, start)

    def send(self, files: Sequence[Outgoing], tally: Tally, jobs: int) -> Iterator[RemoteFile]:
        """Not offered."""
        raise NotImplementedError

    def remove(self, names: Sequence[str]) -> None:
        """Not offered."""
        raise NotImplementedError

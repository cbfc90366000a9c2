"""Data sets on a remote: numbers are copied at the start, videos are read where a picture is wanted.

A block of a video that was read is kept on the disk until the end: pictures are wanted in random order, so
that each block is wanted again in every epoch. The disk has to hold all videos that are learned from.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import io
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from joshua_dataset.cloud.address import AddressError
from joshua_dataset.cloud.copies import store_of
from joshua_dataset.cloud.download import download
from joshua_dataset.cloud.errors import RemoteError
from joshua_dataset.cloud.ledger import Digest
from joshua_dataset.cloud.store import CHUNK, Outgoing, RemoteFile, Store, Tally
from joshua_training.run_folder import RunError, unwritable

from joshua_imitation.scratch import Scratch

MB = 1 << 20

#: What to do where the disk takes no block.
ELSEWHERE = ", or set TMPDIR to another disk, and continue with resume_run"

#: Free space that the videos leave on the disk, bytes.
SPARE = 64 * MB


class Stream:
    """A remote data set.

    Args:
        address: such as ``hf://datasets/NAME/DATA``.
        videos: folder of the blocks of another process of this machine; None to keep its own.

    Attributes:
        address: its own; folder: with its metadata and numbers; videos: blocks of videos, complete or absent.

    Raises:
        RunError: it cannot be read.
    """

    def __init__(self, address: str, videos: Path | None = None) -> None:
        self.address = address
        self._scratch = Scratch("joshua-stream")
        self.folder = self._scratch.path / "data"  # a copy begins in an empty folder
        self.folder.mkdir()
        self.videos = videos or self._scratch.path / "videos"
        self.videos.mkdir(exist_ok=True)
        try:
            self._store = store_of(address)
            self._there = self._store.listing()
            download(_Numbers(self._store, self._there), self.folder, Tally())
        except (RemoteError, AddressError) as error:
            self.close()
            raise RunError(f"{address} cannot be streamed: {error}") from error

    def check_room(self, paths: Iterable[Path]) -> None:
        """Refuse videos that the disk has no space for. Raises RunError.

        Args:
            paths: of the videos, below ``folder``.
        """
        names = {path.relative_to(self.folder).as_posix() for path in paths}
        size = sum(self._there[name].size for name in names if name in self._there)
        free = shutil.disk_usage(self.videos).free
        if free < size + SPARE:
            raise RunError(
                f"the videos of {self.address} take {-(-size // MB)} MB, and {self.videos.parent.parent} has "
                f"{free // MB} MB free, of which {SPARE // MB} MB stay free: free "
                f"{-(-(size + SPARE - free) // MB)} MB there, or set TMPDIR to another disk"
            )

    def opened(self, path: Path) -> io.BufferedIOBase:
        """Open a video of the data set, by its path below ``folder``. Raises RunError."""
        name = path.relative_to(self.folder).as_posix()
        if name not in self._there:
            raise RunError(
                f"{self.address} has no {name}, which its metadata name: upload the data set again"
            )
        return _Video(self, self._there[name])

    def part(self, there: RemoteFile, offset: int, size: int) -> bytes:
        """Return bytes of a file, at most to the end of the block of ``CHUNK`` bytes. Raises RunError."""
        number, start = divmod(offset, CHUNK)
        name = hashlib.sha256(f"{there.name}\n{there.state}\n{number}".encode()).hexdigest()
        path = self.videos / name
        if not path.exists():
            with _alone(path):  # another thread or process that wants the block waits for it
                if not path.exists():
                    self._keep(self._fetched(there, number * CHUNK), path)
        with path.open("rb", buffering=0) as block:
            block.seek(start)
            return block.read(size)

    def _fetched(self, there: RemoteFile, start: int) -> bytes:
        def fetch() -> bytes:
            found = next(iter(self._store.chunks(there, start)), b"")
            if len(found) != min(CHUNK, there.size - start):
                raise RemoteError(f"{there.name} ended at {start + len(found)} bytes", transient=True)
            return found

        try:
            return Tally().patiently(fetch)
        except RemoteError as error:
            raise RunError(f"{there.name} cannot be streamed: {error}: continue with resume_run") from error

    def _keep(self, block: bytes, path: Path) -> None:
        try:
            with tempfile.NamedTemporaryFile(prefix=".", dir=self.videos, delete=False) as draft:
                draft.write(block)
            Path(draft.name).replace(path)  # other processes find it when it is complete
        except OSError as error:
            raise unwritable(self.videos, error, ELSEWHERE) from error

    def close(self) -> None:
        """Remove the copied numbers, and the blocks of videos that are its own."""
        self._scratch.close()


@contextlib.contextmanager
def _alone(path: Path) -> Iterator[None]:
    """Keep all others from fetching a block, in this process or another. Raises RunError."""
    lock = path.with_name(f".{path.name}.lock")
    try:
        file = lock.open("wb")
    except OSError as error:
        raise unwritable(lock, error, ELSEWHERE) from error
    with file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


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
            part = self._stream.part(self._there, self._at, wanted)
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

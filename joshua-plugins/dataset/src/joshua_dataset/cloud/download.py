"""Downloads of data sets: existing files stay, and checksums verify every file received."""

from __future__ import annotations

import hashlib
import shutil
import threading
from collections.abc import Mapping
from pathlib import Path

from joshua.api.files import file_inside, inside

from joshua_dataset.changes import is_interrupted
from joshua_dataset.cloud.copies import (
    INFO_NAME,
    JOBS,
    SUMS,
    Summary,
    differences,
    episode_of,
    is_counted,
    is_ours,
    is_safe,
    remote_dataset,
    size_text,
    summary,
    sums_of,
)
from joshua_dataset.cloud.errors import RemoteError, disk_full
from joshua_dataset.cloud.ledger import Digest, Ledger, rank
from joshua_dataset.cloud.store import ATTEMPTS, RemoteFile, Store, Tally, in_parallel
from joshua_dataset.files import Files
from joshua_dataset.lock import PRIVATE, WriterLock
from joshua_dataset.metadata import INFO
from joshua_dataset.open_episode import read_journal
from joshua_dataset.reader import Dataset

#: Free space that a download leaves on a disk.
SPARE_BYTES = 64 << 20


def download(
    store: Store, folder: Path, tally: Tally, *, jobs: int = JOBS, files: Files | None = None
) -> Summary:
    """Make a folder equal to a remote data set, completing an interrupted download or an older copy.

    Args:
        tally: of this transfer; jobs: files in parallel; files: file operations.

    Raises:
        RemoteError: for example, the folder holds something else.
    """
    there = {name: item for name, item in tally.patiently(store.listing).items() if is_safe(name)}
    if INFO_NAME not in there:
        raise RemoteError(f"{store.address} holds no data set: it has no {INFO_NAME}. Correct the address")
    remote = remote_dataset(store, there, tally)
    sums = sums_of(store, there, tally)
    names = sorted((name for name in there if name not in (SUMS, INFO_NAME)), key=rank)
    names = [name for name in names if is_counted(name, remote.episodes, is_ours(remote.info))]
    names.append(INFO_NAME)
    is_new = not folder.exists() or not any(path.name != PRIVATE for path in folder.iterdir())
    files = files or Files()
    try:
        files.make_folder(folder)
        for name in (*names, f"{PRIVATE}/incoming"):
            inside(folder, name)
        lock = WriterLock(folder)
        lock.take()
    except OSError as error:
        raise RemoteError(f"{folder} cannot be written: {error.strerror or error}") from error
    try:
        if is_interrupted(folder):
            raise RemoteError(
                f"{folder} has a change that was interrupted. Run `joshua dataset repair {folder}` first"
            )
        ledger = Ledger(folder)
        incoming = _Incoming(store, folder, sums, ledger, files, tally)
        has_data = (folder / INFO).is_file()
        if has_data or (not is_new and not incoming.begun):
            _check_local(store, folder, remote)
        tally.begin(len(names), sum(there[name].size for name in names))
        todo = [name for name in names if not incoming.has(there[name])]
        wanted = set(todo)
        if has_data:
            _check_kept(store, folder, Dataset.read(folder), todo)
        _check_room(folder, sum(there[name].size for name in todo) - incoming.bytes)
        for name in names:
            if name not in wanted:
                tally.skip(there[name].size)
        first, last = [there[name] for name in todo if name != INFO_NAME], [n for n in todo if n == INFO_NAME]
        try:
            for _ in in_parallel(incoming.fetch, first, jobs):
                tally.check()
            for name in last:
                incoming.fetch(there[name])
        except OSError as error:
            if not disk_full(error):
                raise RemoteError(f"{folder} cannot be written: {error.strerror or error}") from error
            raise RemoteError(
                f"the disk of {folder} is full: {tally.done_files} of {tally.files} files are complete. "
                "Free some space and run the same command again to resume"
            ) from error
        finally:
            ledger.save()
        incoming.close()
    finally:
        lock.release()
    return summary(store, tally, incoming.unproven)


class _Incoming:
    """Incoming files of a folder; unfinished ones wait in a private folder, by name and content.

    Attributes:
        begun: an earlier download left unfinished files; bytes: their size.
        unproven: files without a checksum.
    """

    def __init__(
        self, store: Store, folder: Path, sums: Mapping[str, str], ledger: Ledger, files: Files, tally: Tally
    ) -> None:
        self._store, self._folder, self._sums, self._ledger = store, folder, sums, ledger
        self._files, self._tally = files, tally
        self._place = inside(folder, Path(PRIVATE) / "incoming", "the folder of unfinished files")
        self.begun = self._place.is_dir()
        self._place.mkdir(parents=True, exist_ok=True)
        self.bytes = sum(path.stat().st_size for path in self._place.iterdir())
        self.unproven = 0
        self._lock = threading.Lock()

    def has(self, there: RemoteFile) -> bool:
        """Return whether the folder has this file."""
        path = inside(self._folder, there.name)
        if not path.is_file() or path.stat().st_size != there.size:
            return False
        return self._fits(there, path, self._ledger.digest(there.name)) is True

    def fetch(self, there: RemoteFile) -> None:
        """Fetch a file, resuming an earlier attempt, and move it into place."""
        name = hashlib.sha256(f"{there.name}\n{there.size}\n{there.state}".encode()).hexdigest()
        part = file_inside(self._folder, self._place / name)
        if part.exists() and part.stat().st_size > there.size:
            part.unlink()
        self._tally.resume(part.stat().st_size if part.exists() else 0)
        for _ in range(ATTEMPTS):
            self._tally.patiently(lambda: self._receive(there, part))
            fits = self._fits(there, part, Digest.of(part))
            if fits is not False:
                self.unproven += fits is None
                self._put(part, self._folder / there.name)
                self._tally.finish()
                return
            part.unlink()
            self._tally.add(-there.size)
        raise RemoteError(f"{self._store.address}: {there.name} arrived damaged {ATTEMPTS} times")

    def close(self) -> None:
        """Remove leftovers of earlier versions."""
        shutil.rmtree(self._place, ignore_errors=True)

    def _receive(self, there: RemoteFile, part: Path) -> None:
        with part.open("ab") as file:
            for chunk in self._store.chunks(there, file.tell()):
                file.write(chunk)
                self._tally.add(len(chunk))

    def _fits(self, there: RemoteFile, path: Path, digest: Digest) -> bool | None:
        same = self._store.same(there, path, digest)
        if same is None and there.name in self._sums:
            same = self._sums[there.name] == digest.sha256
        return same

    def _put(self, part: Path, path: Path) -> None:
        inside(self._folder, path)
        with self._lock:  # two threads must not create the same folder
            self._files.make_folder(path.parent)
        self._files.sync(part)
        self._files.replace(part, path)
        self._files.sync_folder(path.parent)


def _check_local(store: Store, folder: Path, remote: Dataset) -> None:
    """Refuse to download into a folder that holds something else."""
    remedy = "Name another folder"
    if read_journal(folder) is not None:
        raise RemoteError(f"{folder} has an unfinished episode. Run `joshua dataset repair {folder}` first")
    if not (folder / INFO).is_file():
        raise RemoteError(f"{folder} is not empty and holds no data set. {remedy}")
    local = Dataset.read(folder)
    if different := differences(local, remote):
        raise RemoteError(f"{folder} holds a data set that differs: {'; '.join(different)}. {remedy}")
    if local.episodes > remote.episodes:
        raise RemoteError(
            f"{folder} has {local.episodes} episodes, but {store.address} has {remote.episodes}. "
            f"{remedy}, or upload them with `joshua dataset upload`"
        )


def _check_kept(store: Store, folder: Path, local: Dataset, todo: list[str]) -> None:
    """Refuse to replace an episode that was recorded locally."""
    for name in todo if is_ours(local.info) else ():
        number = episode_of(name)
        if number is not None and number < local.episodes and (folder / name).is_file():
            raise RemoteError(
                f"{store.address} has a different episode {number}: {name} differs. Name another folder"
            )


def _check_room(folder: Path, size: int) -> None:
    free = shutil.disk_usage(folder).free
    if size + SPARE_BYTES > free:
        raise RemoteError(
            f"the disk of {folder} has {size_text(free)} left, and the download needs {size_text(size)}: "
            "free some space, or name another folder"
        )

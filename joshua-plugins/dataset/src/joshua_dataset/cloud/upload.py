"""Uploads of data sets: existing remote files stay, and checksums verify every file sent."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path

from joshua.api.files import UnsafePathError
from joshua.features import EpisodeError

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
    summary,
)
from joshua_dataset.cloud.errors import RemoteError
from joshua_dataset.cloud.ledger import Digest, Ledger, names_of
from joshua_dataset.cloud.sessions import Sessions
from joshua_dataset.cloud.store import Outgoing, RemoteFile, Store, Tally, read_back
from joshua_dataset.files import cause, remedy_first
from joshua_dataset.metadata import INFO
from joshua_dataset.reader import Dataset, DatasetError
from joshua_dataset.watching import Watch


def upload(folder: Path, store: Store, tally: Tally, *, jobs: int = JOBS, replace: bool = False) -> Summary:
    """Make a remote equal to a local data set.

    Args:
        tally: of this transfer; jobs: files in parallel.
        replace: replace remote files that differ, and remove those that do not exist locally.

    Raises:
        DatasetError: the folder holds no data set; RemoteError.
    """
    if is_interrupted(folder):
        raise RemoteError(
            f"{folder} has a change that was interrupted. Run `joshua dataset repair {folder}` first"
        )
    try:
        return _upload(folder, store, tally, jobs, replace=replace)
    except OSError as error:
        raise RemoteError(
            f"{error.filename or folder}: {cause(error)}. {folder} stays as it is, and {store.address} keeps "
            f"its old {INFO_NAME}. {remedy_first(error, 'run the same command again')}"
        ) from error


def _upload(folder: Path, store: Store, tally: Tally, jobs: int, *, replace: bool) -> Summary:
    # A snapshot of the metadata: a recorder may add episodes meanwhile.
    dataset = Dataset.read(folder)
    content = (folder / INFO).read_bytes()
    ledger = Ledger(folder)
    store.sessions = Sessions(folder, str(store.address))
    try:
        found = list(names_of(folder))
    except UnsafePathError as error:
        raise DatasetError(f"{folder} cannot be uploaded: {error}") from error
    names = [name for name in found if is_counted(name, dataset.episodes, is_ours(dataset.info))]
    if SUMS in names:
        names.remove(SUMS)
    with tempfile.TemporaryDirectory(prefix="joshua-upload-") as scratch:
        info = Path(scratch) / "info.json"
        info.write_bytes(content)
        watch = Watch()
        for name in names:
            if episode_of(name) is not None:
                watch.add(folder / name)
        files = {name: Outgoing(name, folder / name, ledger.digest(name)) for name in names}
        last = {INFO_NAME: Outgoing(INFO_NAME, info, Digest.of(info))}
        if store.keeps_sums:
            sums = Path(scratch) / SUMS
            rows = [f"{item.digest.sha256}  {name}\n" for name, item in [*files.items(), *last.items()]]
            sums.write_text("".join(sorted(rows, key=lambda row: row[66:])), encoding="utf-8")
            last = {SUMS: Outgoing(SUMS, sums, Digest.of(sums)), **last}
        tally.begin(len(files) + len(last), sum(i.digest.size for i in [*files.values(), *last.values()]))
        tally.patiently(store.prepare)
        there = tally.patiently(store.listing)
        try:
            fitting = _Comparison(store, ledger, there, tally)
            if not replace:
                _check_remote(store, dataset, there, files, fitting, tally)
            else:
                spare = [name for name in there if name not in files and name not in last and _may_go(name)]
                if spare:
                    tally.patiently(lambda: store.remove(spare))
            todo = []
            for item in files.values():
                if fitting.same(item):
                    tally.skip(item.digest.size)
                else:
                    todo.append(item)
            _send(store, todo, tally, jobs, ledger)
            try:
                watch.check()
            except EpisodeError as error:
                raise RemoteError(str(error)) from error
            for item in last.values():
                if fitting.same(item):
                    tally.skip(item.digest.size)
                else:
                    _send(store, [item], tally, 1, ledger)
            if tally.moved_files:
                tally.patiently(lambda: store.published(dataset.version))
        finally:
            ledger.save()
    return summary(store, tally)


class _Comparison:
    """Finds out which files a remote has: from checksums, from earlier proofs, else by reading them back."""

    def __init__(self, store: Store, ledger: Ledger, there: Mapping[str, RemoteFile], tally: Tally) -> None:
        self._store, self._ledger, self._there, self._tally = store, ledger, there, tally
        self._known: dict[str, bool] = {}

    def same(self, item: Outgoing) -> bool:
        """Return whether the remote has this file."""
        if item.name not in self._known:
            found = self._there.get(item.name)
            self._known[item.name] = found is not None and self._compare(found, item)
        return self._known[item.name]

    def _compare(self, found: RemoteFile, item: Outgoing) -> bool:
        same = self._store.same(found, item.path, item.digest)
        if same is None:
            remote = str(self._store.address)
            sha256 = self._ledger.proven(remote, item.name, found.state)
            if not sha256:
                sha256 = read_back(self._store, found, self._tally)
                self._ledger.prove(remote, item.name, found.state, sha256)
            same = sha256 == item.digest.sha256
        return same


def _send(store: Store, files: list[Outgoing], tally: Tally, jobs: int, ledger: Ledger) -> None:
    digests = {item.name: item.digest for item in files}
    for found in store.send(files, tally, jobs):
        if found.state:
            ledger.prove(str(store.address), found.name, found.state, digests[found.name].sha256)
        if tally.moved_files % 50 == 0:
            ledger.save()


def _check_remote(
    store: Store,
    dataset: Dataset,
    there: Mapping[str, RemoteFile],
    files: Mapping[str, Outgoing],
    fitting: _Comparison,
    tally: Tally,
) -> None:
    """Refuse to overwrite a different data set, or one with more episodes."""
    remedy = "Name another remote_url, or replace the remote copy with `joshua dataset upload --replace`"
    if INFO_NAME not in there:
        return
    remote = remote_dataset(store, there, tally)
    if different := differences(dataset, remote):
        raise RemoteError(f"{store.address} holds a data set that differs: {'; '.join(different)}. {remedy}")
    if remote.episodes > dataset.episodes:
        raise RemoteError(
            f"{store.address} has {remote.episodes} episodes, but {dataset.folder} has {dataset.episodes}: "
            f"an upload would lose some. Download it into another folder first. {remedy}"
        )
    if not is_ours(dataset.info):
        return  # another program appends to its files
    for name, item in files.items():
        number = episode_of(name)
        if number is not None and number < remote.episodes and name in there and not fitting.same(item):
            raise RemoteError(f"{store.address} has a different episode {number}: {name} differs. {remedy}")


def _may_go(name: str) -> bool:
    """Return whether a file missing locally may be removed from a remote, whose own files stay."""
    return is_safe(name) and name != "README.md"

"""Data sets on the Hugging Face Hub, over its own protocol: content first, then a commit that lists it."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from joshua_dataset.cloud.address import Address
from joshua_dataset.cloud.errors import RemoteError, StoppedError, require_library, translated
from joshua_dataset.cloud.ledger import Digest
from joshua_dataset.cloud.lfs import LEAST, send_in_parts
from joshua_dataset.cloud.store import ATTEMPTS, CHUNK, Outgoing, RemoteFile, Store, Tally, in_parallel

#: Number of files in one commit.
COMMIT_FILES = 100

CARD = """\
---
license: apache-2.0
task_categories:
- robotics
tags:
- LeRobot
configs:
- config_name: default
  data_files: data/*/*.parquet
---

This data set was recorded with JOSHUA in the layout of LeRobot.
"""


class Hub(Store):
    """Data set repository on the Hub.

    Args:
        address: of the repository, with a revision and a folder if it names them.
    """

    keeps_sums = False  # the Hub has its own checksums

    def __init__(self, address: Address) -> None:
        super().__init__(address)
        require_library(address)
        with self._translating("opening it"):
            from huggingface_hub import HfApi
            from huggingface_hub.utils.tqdm import disable_progress_bars

            disable_progress_bars()
            self._api = HfApi(library_name="joshua")
        self._repository, self._revision, folder = address.hub
        self._prefix = f"{folder}/" if folder else ""
        self._has_card = False

    def prepare(self) -> None:
        """Create the repository as private; an existing one stays unchanged."""
        with self._translating("creating the repository"):
            self._api.create_repo(self._repository, repo_type="dataset", private=True, exist_ok=True)
            if self._revision is not None:
                self._api.create_branch(
                    self._repository, repo_type="dataset", branch=self._revision, exist_ok=True
                )

    def listing(self) -> dict[str, RemoteFile]:
        """See ``Store``."""
        from huggingface_hub.errors import EntryNotFoundError, RepositoryNotFoundError, RevisionNotFoundError

        with self._translating("listing it"):
            try:
                tree = list(
                    self._api.list_repo_tree(
                        self._repository, repo_type="dataset", revision=self._revision, recursive=True
                    )
                )
            except (EntryNotFoundError, RevisionNotFoundError):
                return {}
            except RepositoryNotFoundError as error:
                if getattr(error.response, "status_code", 0) == 401:
                    raise
                return {}
        self._has_card = any(item.path == "README.md" for item in tree)
        files = (_remote_file(item, self._prefix) for item in tree if hasattr(item, "size"))
        return {item.name: item for item in files if item is not None}

    def same(self, there: RemoteFile, path: Path, digest: Digest) -> bool | None:
        """See ``Store``."""
        del path
        if there.size != digest.size:
            return False
        sums = dict(there.checksums)
        return sums["sha256"] == digest.sha256 if "sha256" in sums else sums["blob"] == digest.blob

    def send(self, files: Sequence[Outgoing], tally: Tally, jobs: int) -> Iterator[RemoteFile]:
        """See ``Store``."""
        waiting = list(files)
        for _ in range(ATTEMPTS):
            damaged: list[Outgoing] = []
            for start in range(0, len(waiting), COMMIT_FILES):
                batch = waiting[start : start + COMMIT_FILES]
                there = self._commit(batch, tally, jobs)
                for item in batch:
                    found = there.get(item.name)
                    if found is not None and self.same(found, item.path, item.digest):
                        tally.finish()
                        yield found
                    else:
                        tally.add(-item.digest.size)
                        damaged.append(item)
            waiting = damaged
        if waiting:
            raise RemoteError(f"{self.address}: {waiting[0].name} arrived damaged {ATTEMPTS} times")

    def chunks(self, there: RemoteFile, start: int) -> Iterator[bytes]:
        """See ``Store``."""
        from huggingface_hub import HfFileSystem

        revision = f"@{self._revision.replace('/', '%2F')}" if self._revision else ""
        with self._translating(f"reading {there.name}"):
            place = f"datasets/{self._repository}{revision}/{self._prefix}{there.name}"
            files: Any = HfFileSystem(skip_instance_cache=True)
            file = files.open(place, "rb", block_size=CHUNK, cache_type="none")
        with contextlib.closing(file):
            file.seek(start)
            while start < there.size:
                with self._translating(f"reading {there.name}"):
                    data: bytes = file.read(min(CHUNK, there.size - start))
                if not data:
                    raise RemoteError(f"{self.address}: {there.name} ended at {start} bytes", transient=True)
                start += len(data)
                yield data

    def remove(self, names: Sequence[str]) -> None:
        """See ``Store``."""
        from huggingface_hub import CommitOperationDelete

        with self._translating("removing files"):
            self._api.create_commit(
                self._repository,
                [CommitOperationDelete(self._prefix + name, is_folder=False) for name in names],
                commit_message="Remove files",
                repo_type="dataset",
                revision=self._revision,
            )

    def published(self, version: str) -> None:
        """Tag the data set with the version of its layout, which LeRobot looks for; add a card."""
        if self._prefix:
            return
        from huggingface_hub import CommitOperationAdd
        from huggingface_hub.errors import RevisionNotFoundError

        with self._translating("publishing it"):
            if not self._has_card:
                self._api.create_commit(
                    self._repository,
                    [CommitOperationAdd("README.md", CARD.encode())],
                    commit_message="Add a card",
                    repo_type="dataset",
                    revision=self._revision,
                )
            with contextlib.suppress(RevisionNotFoundError):
                self._api.delete_tag(self._repository, tag=version, repo_type="dataset")
            self._api.create_tag(
                self._repository, tag=version, revision=self._revision, repo_type="dataset", exist_ok=True
            )

    def _commit(self, batch: Sequence[Outgoing], tally: Tally, jobs: int) -> dict[str, RemoteFile]:
        """Send contents in parallel, then commit them; content received once is not sent again."""
        from huggingface_hub import CommitOperationAdd
        from huggingface_hub.utils._runtime import is_xet_available

        operations: dict[str, Any] = {}
        in_parts = not is_xet_available()

        def content(item: Outgoing) -> None:
            moved = 0
            try:
                with self._translating(f"sending {item.name}"):
                    if in_parts and item.digest.size > LEAST:
                        moved = send_in_parts(self._repository, self._revision, item, self.sessions, tally)
                    operation = CommitOperationAdd(self._prefix + item.name, str(item.path))
                    self._api.preupload_lfs_files(
                        self._repository,
                        [operation],
                        repo_type="dataset",
                        revision=self._revision,
                        num_threads=1,
                        free_memory=False,
                    )
            except RemoteError:
                tally.resume(-moved)
                raise
            operations[item.name] = operation
            tally.add(item.digest.size - moved)

        def commit() -> dict[str, RemoteFile]:
            with self._translating("the commit"):
                self._api.create_commit(
                    self._repository,
                    [operations[item.name] for item in batch],
                    commit_message=f"Upload {len(batch)} files",
                    repo_type="dataset",
                    revision=self._revision,
                    num_threads=jobs,
                )
                paths = [self._prefix + item.name for item in batch]
                found = self._api.get_paths_info(
                    self._repository, paths, repo_type="dataset", revision=self._revision
                )
                files = (_remote_file(item, self._prefix) for item in found)
                return {item.name: item for item in files if item is not None}

        for _ in in_parallel(lambda item: tally.patiently(lambda: content(item)), batch, jobs):
            tally.check()
        return tally.patiently(commit)

    @contextlib.contextmanager
    def _translating(self, doing: str) -> Iterator[None]:
        try:
            yield
        except StoppedError:
            raise
        except Exception as error:
            raise translated(error, self.address, doing) from error


def _remote_file(item: Any, prefix: str) -> RemoteFile | None:
    if not item.path.startswith(prefix):
        return None
    sums = (("sha256", item.lfs.sha256),) if item.lfs is not None else (("blob", item.blob_id),)
    return RemoteFile(item.path.removeprefix(prefix), item.size, sums, sums[0][1])

"""Shared parts of uploads and downloads: the files of a data set, and the comparison of two data sets."""

from __future__ import annotations

import logging
import re
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from joshua.api.files import name_fault

from joshua_dataset.cloud.address import Address
from joshua_dataset.cloud.bucket import Bucket
from joshua_dataset.cloud.errors import RemoteError
from joshua_dataset.cloud.hub import Hub
from joshua_dataset.cloud.store import RemoteFile, Store, Tally
from joshua_dataset.meta_files import LARGEST_JSON
from joshua_dataset.metadata import CHUNK_SIZE, INFO, OURS, TASKS
from joshua_dataset.reader import Dataset, DatasetError

#: Number of files transferred in parallel.
JOBS = 4

#: Checksum file beside a data set whose remote keeps no checksums; ``sha256sum --check`` reads it.
SUMS = "SHA256SUMS"

#: Tasks of a data set in LeRobot's layout v2.
V2_TASKS = INFO.with_name("tasks.jsonl")

#: Counts the episodes, so it is moved last: a reader of an unfinished copy sees the previous state.
INFO_NAME = INFO.as_posix()

#: Libraries whose log lines may contain signed addresses; their errors are raised anyway.
_LIBRARIES = (
    *("huggingface_hub", "httpx", "httpx2", "httpcore", "httpcore2", "urllib3", "requests"),
    *("fsspec", "s3fs", "aiobotocore", "botocore", "aiohttp", "gcsfs", "google", "asyncio"),
)

_EPISODE = re.compile(r"chunk-(\d+)/(?:file|episode)-(\d+)")
_SUM = re.compile(r"([0-9a-f]{64}) [ *](.+)")


@dataclass(frozen=True)
class Summary:
    """Summary of a transfer.

    Attributes:
        address: of the remote; files: of the data set; moved_files, moved_bytes: by this transfer.
        seconds: its duration; unproven: files for which neither side had a checksum.
    """

    address: str
    files: int
    moved_files: int
    moved_bytes: int
    seconds: float
    unproven: int = 0

    def __str__(self) -> str:
        if not self.moved_files:
            return f"{self.address}: all {self.files} files were there already"
        text = (
            f"{self.address}: {self.moved_files} of {self.files} files moved, {size_text(self.moved_bytes)}"
        )
        text += f" in {self.seconds:.1f} s ({size_text(self.moved_bytes / max(self.seconds, 1e-3))}/s)"
        if self.unproven:
            text += f"; {self.unproven} remote files have no checksum, and only their sizes were compared"
        return text


def store_of(text: str) -> Store:
    """Open the remote of an address. Raises AddressError, RemoteError."""
    address = Address.parse(text)
    for name in _LIBRARIES:
        logging.getLogger(name).setLevel(logging.CRITICAL)
    return Hub(address) if address.scheme == "hf" else Bucket(address)


def differences(here: Dataset, there: Dataset) -> list[str]:
    """Return a phrase for each difference between two data sets."""
    pairs = {
        "format": (here.format, there.format),
        "fps": (here.fps, there.fps),
        "robot_type": (here.robot_type, there.robot_type),
        **{name: (value, there.identity.get(name, value)) for name, value in here.identity.items()},
    }
    found = [
        f"{name} is {ours} on this machine and {theirs} at the remote"
        for name, (ours, theirs) in pairs.items()
        if ours != theirs
    ]
    return found + here.features.differences(there.features)


def remote_dataset(store: Store, there: Mapping[str, RemoteFile], tally: Tally) -> Dataset:
    """Read the metadata of a remote data set. Raises RemoteError."""
    with tempfile.TemporaryDirectory(prefix="joshua-remote-") as scratch:
        folder = Path(scratch)
        for name in (item.as_posix() for item in (INFO, TASKS, V2_TASKS)):
            if name in there:
                path = folder / name
                path.parent.mkdir(exist_ok=True)
                path.write_bytes(_content(store, there[name], tally))
        try:
            return Dataset.read(folder)
        except DatasetError as error:
            raise RemoteError(f"{store.address} holds no data set: {error}") from error


def _content(store: Store, there: RemoteFile, tally: Tally) -> bytes:
    if there.size > LARGEST_JSON:
        raise RemoteError(
            f"{store.address}: {there.name} has {there.size} bytes, which is too large for metadata"
        )
    return tally.patiently(lambda: b"".join(store.chunks(there, 0)))


def sums_of(store: Store, there: Mapping[str, RemoteFile], tally: Tally) -> dict[str, str]:
    """Read the SHA-256 of the files by name from the checksum file. Raises RemoteError."""
    if SUMS not in there or not store.keeps_sums:
        return {}
    text = _content(store, there[SUMS], tally).decode("utf-8", "replace")
    return {match[2]: match[1] for line in text.splitlines() if (match := _SUM.fullmatch(line))}


def is_ours(info: Mapping[str, Any]) -> bool:
    """Return whether each episode has its own files, which never change."""
    return OURS in info


def episode_of(name: str) -> int | None:
    """Return the episode that a file belongs to; None for a file shared by all episodes."""
    match = _EPISODE.search(name)
    return int(match[1]) * CHUNK_SIZE + int(match[2]) if match else None


def is_counted(name: str, episodes: int, is_ours: bool) -> bool:
    """Return whether a file belongs to the first episodes; a recorder may be writing the next one."""
    number = episode_of(name)
    return not is_ours or number is None or number < episodes


def is_safe(name: str) -> bool:
    """Return whether a remote file name is one of a data set and stays inside its folder."""
    parts = name.split("/")
    return not any(part.startswith(".") or name_fault(part) for part in parts)


def summary(store: Store, tally: Tally, unproven: int = 0) -> Summary:
    """Summarise a transfer."""
    return Summary(
        str(store.address), tally.files, tally.moved_files, tally.moved_bytes, tally.elapsed_s, unproven
    )


def size_text(count: float) -> str:
    """Format a number of bytes for people."""
    return (
        f"{count / 1e3:.1f} kB"
        if count < 1e6
        else f"{count / 1e6:.1f} MB"
        if count < 1e9
        else f"{count / 1e9:.2f} GB"
    )


def progress_text(tally: Tally) -> str:
    """Describe the progress of a transfer on one line."""
    left = tally.remaining_s
    done, size = size_text(tally.done_bytes), size_text(tally.bytes)
    text = f"{tally.done_files} of {tally.files} files, {done} of {size}"
    if left is not None:
        text += f", {size_text(tally.rate)}/s, {left:.0f} s left"
    return text

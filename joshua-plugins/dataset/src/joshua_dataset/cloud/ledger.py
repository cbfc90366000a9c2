"""Checksums of local files and of verified remote files, kept between transfers."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from joshua.api.files import file_inside
from joshua.tools import parse_json

from joshua_dataset.files import Files
from joshua_dataset.lock import PRIVATE
from joshua_dataset.metadata import INFO

NAME = "transfers.json"

_BLOCK = 1 << 20


@dataclass(frozen=True)
class Digest:
    """Checksums of a file's content, hexadecimal; ``blob`` is git's."""

    size: int
    sha256: str
    md5: str
    blob: str

    @classmethod
    def of(cls, path: Path) -> Digest:
        """Compute the checksums of a file. Raises OSError."""
        size = path.stat().st_size
        sha256, md5 = hashlib.sha256(), hashlib.md5(usedforsecurity=False)
        blob = hashlib.sha1(f"blob {size}\0".encode(), usedforsecurity=False)
        with path.open("rb") as file:
            while block := file.read(_BLOCK):
                for one in (sha256, md5, blob):
                    one.update(block)
        return cls(size, sha256.hexdigest(), md5.hexdigest(), blob.hexdigest())


def etag_in_parts(path: Path, part: int) -> str:
    """Return the ETag that S3 gives to an object uploaded in parts of this size. Raises OSError."""
    digests = []
    with path.open("rb") as file:
        while block := file.read(part):
            digests.append(hashlib.md5(block, usedforsecurity=False).digest())
    return f"{hashlib.md5(b''.join(digests), usedforsecurity=False).hexdigest()}-{len(digests)}"


class Ledger:
    """Cache of checksums in the private folder of a data set.

    Args:
        folder: of the data set.
    """

    def __init__(self, folder: Path) -> None:
        self._folder, self._path = folder, folder / PRIVATE / NAME
        self._lock = threading.Lock()
        self._digests: dict[str, Any] = {}
        self._remotes: dict[str, dict[str, Any]] = {}
        with contextlib.suppress(OSError, ValueError, KeyError, TypeError, AttributeError):
            file_inside(folder, self._path)
            record = parse_json(self._path.read_text(encoding="utf-8"))
            digests, remotes = dict(record["digests"]), dict(record["remotes"])
            self._digests, self._remotes = digests, {key: dict(value) for key, value in remotes.items()}

    def digest(self, name: str) -> Digest:
        """Return the checksums of a file of the data set. Raises OSError."""
        path = self._folder / name
        state = path.stat()
        key = [state.st_size, state.st_mtime_ns]
        known = self._digests.get(name)
        if isinstance(known, list) and len(known) == 5 and known[:2] == key:
            return Digest(state.st_size, *map(str, known[2:]))
        found = Digest.of(path)
        with self._lock:
            self._digests[name] = [*key, found.sha256, found.md5, found.blob]
        return found

    def proven(self, remote: str, name: str, state: str) -> str:
        """Return the SHA-256 of a remote file that was read back in this state; "" if it was not."""
        known = self._remotes.get(remote, {}).get(name)
        return str(known[1]) if isinstance(known, list) and state and known[0] == state else ""

    def prove(self, remote: str, name: str, state: str, sha256: str) -> None:
        """Store the checksum of a remote file."""
        with self._lock:
            self._remotes.setdefault(remote, {})[name] = [state, sha256]

    def save(self) -> None:
        """Write the ledger; skipped if the folder is not writable."""
        with self._lock, contextlib.suppress(OSError):
            self._path.parent.mkdir(exist_ok=True)
            content = json.dumps({"digests": self._digests, "remotes": self._remotes})
            Files().write(file_inside(self._folder, self._path), content.encode())


def names_of(folder: Path) -> Iterator[str]:
    """Yield the files of a data set, data before metadata, without ``meta/info.json`` and hidden files.

    Raises:
        UnsafePathError: one is a symlink that leads out of the folder.
    """
    found = []
    for place, folders, files in os.walk(folder):
        folders[:] = sorted(item for item in folders if not item.startswith("."))
        for file in sorted(files):
            path = Path(place) / file
            if not file.startswith(".") and path.suffix != ".new" and path.is_file():
                file_inside(folder, path, "the file")
                found.append(path.relative_to(folder).as_posix())
    yield from sorted((name for name in found if name != INFO.as_posix()), key=rank)


def rank(name: str) -> tuple[int, str]:
    """Return the sort key of a transfer: a file follows the files that it references."""
    return (0 if not name.startswith("meta/") else 1 if name.startswith("meta/episodes") else 2, name)

"""Files that must outlive a kill, a power cut and a full disk: the operations that all commands share.

Three rules hold for everything built on them:

* A step that fails, or cannot read, removes nothing.
* An error of the system, such as a full disk, is never taken for damage of a file.
* What cannot be mended is moved aside, never deleted.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import json
import os
import socket
import time
from pathlib import Path
from typing import Any

from joshua.plan.json_text import parse_json

#: Errors that say something about the system, and nothing about the content of a file.
SYSTEM_ERRORS = frozenset(
    {
        *(errno.ENOSPC, errno.EDQUOT, errno.EFBIG),
        *(errno.EACCES, errno.EPERM, errno.EROFS),
        *(errno.EIO, errno.ENODEV, errno.ENXIO, errno.ESTALE, errno.ETIMEDOUT, errno.ENOTCONN),
        *(errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.ENOLCK, errno.EBUSY, errno.EINTR, errno.EAGAIN),
    }
)

#: Errors of a disk, or of a quota, without free space.
NO_SPACE = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})

_REMEDIES = {
    errno.ENOSPC: "Free some space",
    errno.EDQUOT: "Free some space, or have your disk quota raised",
    errno.EFBIG: "Raise the limit of file sizes (`ulimit -f`)",
    errno.EROFS: "The disk is read-only: `dmesg` says why. Mount it again",
    errno.EACCES: "Make it readable and writable for your user",
    errno.EPERM: "Make it readable and writable for your user",
    errno.EIO: "Check the disk and its cable",
    errno.ENODEV: "Check the disk and its cable",
    errno.ENXIO: "Check the disk and its cable",
    errno.ESTALE: "Check the network disk",
    errno.ENOTCONN: "Check the network disk",
    errno.EMFILE: "Raise the limit of open files (`ulimit -n`)",
    errno.ENFILE: "Close other programs: this machine has too many open files",
    errno.ENOMEM: "Close other programs: this machine has too little memory",
}


def is_system_error(error: BaseException) -> bool:
    """Return whether an error says that the system refused, rather than that a file is damaged."""
    return isinstance(error, MemoryError) or getattr(error, "errno", None) in SYSTEM_ERRORS


def remedy(error: BaseException) -> str:
    """Return what to do about an error of the system, as an imperative; "" for other errors."""
    return _REMEDIES.get(getattr(error, "errno", None) or 0, "")


class Files:
    """The operations whose order decides what a kill or a power cut leaves behind.

    A test may replace them by operations that fail, or that record what is safe on the disk.
    """

    def sync(self, path: Path) -> None:
        """Flush the content of a file to the disk. Raises OSError."""
        self._sync(path, os.O_RDONLY)

    def sync_folder(self, folder: Path) -> None:
        """Flush the names in a folder to the disk. Raises OSError."""
        self._sync(folder, os.O_RDONLY | os.O_DIRECTORY)

    def replace(self, source: Path, target: Path) -> None:
        """Move a file into place. Raises OSError."""
        source.replace(target)

    def make_folder(self, folder: Path) -> None:
        """Create a folder and its parents, and flush their names. Raises OSError."""
        if folder.is_dir():
            return
        if folder.exists():
            raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(folder))
        self.make_folder(folder.parent)
        folder.mkdir(exist_ok=True)
        self.sync_folder(folder.parent)

    def write(self, path: Path, content: bytes) -> None:
        """Write a file: after a kill or a power cut it has the old content or the new one.

        Raises:
            OSError: the old content is unchanged.
        """
        draft = path.with_name(f".{path.name}.part")
        try:
            draft.unlink(missing_ok=True)  # of a kill; a link there is not followed
            with draft.open("xb") as file:
                file.write(content)
            self.sync(draft)
            self.replace(draft, path)
        except BaseException:
            with contextlib.suppress(OSError):
                draft.unlink(missing_ok=True)
            raise
        self.sync_folder(path.parent)

    def move_aside(self, path: Path, into: Path, name: str) -> Path:
        """Move a file or folder out of the way with one rename, which needs no space; return its place.

        Args:
            into: folder on the same disk; name: of the new place, which gets a number if it is taken.

        Raises:
            OSError: it stays where it is.
        """
        self.make_folder(into)
        target = free_name(into, name)
        self.replace(path, target)
        self.sync_folder(into)
        self.sync_folder(path.parent)
        return target

    @staticmethod
    def _sync(path: Path, flags: int) -> None:
        descriptor = os.open(path, flags)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def free_name(folder: Path, name: str) -> Path:
    """Return a path in a folder that nothing has yet: the name, or the name and a number."""
    found, number = folder / name, 1
    while os.path.lexists(found):
        number += 1
        found = folder / f"{name}-{number}"
    return found


class LockTaken(Exception):
    """Another process has the lock.

    Attributes:
        owner: the process, in words.
    """

    def __init__(self, owner: str) -> None:
        super().__init__(owner)
        self.owner = owner


class FileLock:
    """Lock that one process has at a time, names its owner and ends with the owner's process.

    A full disk does not refuse the lock; its owner is then unnamed.

    Args:
        path: of the lock file, which is removed on release.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file: Any = None

    @property
    def is_held(self) -> bool:
        """Whether this object has the lock."""
        return self._file is not None

    def take(self) -> None:
        """Take the lock, without waiting. Raises LockTaken, and OSError."""
        self._path.parent.mkdir(parents=True, exist_ok=True)
        while True:
            file = self._path.open("a+", encoding="utf-8")
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                file.seek(0)
                text = file.read()
                file.close()
                raise LockTaken(_owner(text)) from None
            except OSError:
                file.close()
                raise
            # the previous owner may have removed the file that was locked here
            if self._path.exists() and os.path.samestat(os.fstat(file.fileno()), self._path.stat()):
                break
            file.close()
        self._file = file
        started = time.strftime("%Y-%m-%d %H:%M:%S")
        record = {"process": os.getpid(), "host": socket.gethostname(), "since": started}
        with contextlib.suppress(OSError):  # the name of the owner is only for messages
            os.ftruncate(file.fileno(), 0)
            os.write(file.fileno(), json.dumps(record).encode())

    def require_free(self) -> None:
        """Check that no other process has it, without a change. Raises LockTaken."""
        with contextlib.suppress(OSError), self._path.open(encoding="utf-8") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
            except BlockingIOError:
                raise LockTaken(_owner(file.read())) from None

    def release(self) -> None:
        """Release the lock. Idempotent."""
        if self._file is None:
            return
        with contextlib.suppress(OSError):  # the disk may be disconnected
            self._path.unlink(missing_ok=True)
            self._path.parent.rmdir()
        self._file.close()
        self._file = None


def _owner(text: str) -> str:
    try:
        record = parse_json(text)
        return f"process {record['process']} on {record['host']} since {record['since']}"
    except (ValueError, KeyError, TypeError):
        return "another process"

"""Folders for temporary files. Those of a killed process are removed when the next one starts."""

from __future__ import annotations

import fcntl
import os
import shutil
import tempfile
from pathlib import Path

from joshua_training.run_folder import unwritable

#: File in such a folder, locked while it is used. A folder without it was made by somebody else.
LOCK = ".joshua-scratch"


class Scratch:
    """A folder below ``TMPDIR``, until ``close``.

    Args:
        name: of the folder, which is made unique, such as ``joshua-pictures``.

    Attributes:
        path: of the folder.

    Raises:
        RunError: it cannot be written.
    """

    def __init__(self, name: str) -> None:
        place = Path(tempfile.gettempdir())
        remove_left(place)
        try:
            draft = Path(tempfile.mkdtemp(prefix=f".{name}-", dir=place))
            self._handle = os.open(draft / LOCK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
            _locked(self._handle)
            # found by others only when it is locked
            self.path = draft.rename(place / draft.name.removeprefix("."))
        except OSError as error:
            raise unwritable(place, error, ", or set TMPDIR to another folder") from error

    def close(self) -> None:
        """Remove the folder. Idempotent."""
        shutil.rmtree(self.path, ignore_errors=True)
        handle, self._handle = self._handle, -1
        if handle >= 0:
            os.close(handle)


def remove_left(place: Path) -> None:
    """Remove the folders of processes that were killed."""
    for lock in place.glob(f"joshua-*/{LOCK}"):
        try:
            handle = os.open(lock, os.O_RDWR | os.O_CLOEXEC | os.O_NOFOLLOW)
        except OSError:  # of another user, or gone meanwhile
            continue
        try:
            if os.fstat(handle).st_uid == os.getuid() and _locked(handle):
                shutil.rmtree(lock.parent, ignore_errors=True)
        finally:
            os.close(handle)


def _locked(handle: int) -> bool:
    """Lock a file; return False if another process has it, or the file system has no locks."""
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True

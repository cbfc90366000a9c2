"""Lock that allows one writer per data set, names its owner and ends with the owner's process."""

from __future__ import annotations

from pathlib import Path

from joshua.api.files import FileLock, LockTaken, file_inside
from joshua.features import EpisodeError

#: Folder of the writer's own files inside a data set; readers of LeRobot's layout ignore it.
PRIVATE = ".joshua"

_LOCK = "lock"


class WriterLock:
    """Lock against a second writer of a data set; every command that changes a data set takes it.

    Args:
        folder: of the data set.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._lock = FileLock(folder / PRIVATE / _LOCK)

    @property
    def is_held(self) -> bool:
        """Whether this object has the lock."""
        return self._lock.is_held

    def take(self) -> None:
        """Take the lock. Raises EpisodeError that names the owner, and OSError."""
        private = self._folder / PRIVATE
        if private.is_symlink():
            raise EpisodeError(
                f"{private} is a link, and a data set keeps its own files inside itself. Remove the link"
            )
        file_inside(self._folder, private / _LOCK, "the lock")
        try:
            self._lock.take()
        except LockTaken as error:
            raise self._taken(error) from None

    def require_free(self) -> None:
        """Check that no other process writes, without a change.

        Raises:
            EpisodeError: another process writes; the message names it.
            UnsafePathError: the lock is elsewhere, or not a file.
        """
        file_inside(self._folder, Path(PRIVATE) / _LOCK, "the lock")
        try:
            self._lock.require_free()
        except LockTaken as error:
            raise self._taken(error) from None

    def release(self) -> None:
        """Release the lock. Idempotent."""
        self._lock.release()

    def _taken(self, error: LockTaken) -> EpisodeError:
        return EpisodeError(
            f"{self._folder} is being written by {error.owner}. "
            "Stop that recording, or name another local_path"
        )

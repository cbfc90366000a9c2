"""Notice that files which are read are changed meanwhile."""

from __future__ import annotations

from pathlib import Path

from joshua.features import EpisodeError


class Watch:
    """Finds out whether another command changed an episode while it was read."""

    def __init__(self) -> None:
        self._before: dict[Path, tuple[int, int, int]] = {}

    def add(self, path: Path) -> None:
        """Watch a file. Raises OSError."""
        self._before[path] = self._state(path)

    def check(self) -> None:
        """Raise EpisodeError if a file is another one."""
        for path, before in self._before.items():
            try:
                now = self._state(path)
            except FileNotFoundError:
                now = (0, 0, 0)
            if now != before:
                raise EpisodeError(
                    f"{path} was changed by another command meanwhile. Run the same command again"
                )

    @staticmethod
    def _state(path: Path) -> tuple[int, int, int]:
        found = path.stat()
        return found.st_ino, found.st_size, found.st_mtime_ns

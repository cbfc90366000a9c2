"""The e-stop latches of a user, at every base where systems of his may run."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from pathlib import Path

from joshua.guardian.latch import Latch, LatchFolder
from joshua.supervisor.run_directory import latch_folder


class UserLatches:
    """Sets, finds and releases latches.

    Args:
        bases: as ``base_directories`` lists them.
    """

    def __init__(self, bases: Sequence[Path]) -> None:
        self._folders = {base: LatchFolder(latch_folder(base)) for base in bases}

    def at(self, base: Path) -> LatchFolder:
        """The latches of the systems at one base."""
        return self._folders[base]

    def set(self, base: Path, robot: str, source: str, domain_id: int, nodes: Sequence[str]) -> Latch:
        """Latches actuators; returns the latch at a base.

        It is set at the other bases too: the robot's next run may start in another environment.

        Raises:
            OSError: it cannot be set at that base.
        """
        latch = self._folders[base].set(robot, source, domain_id, nodes)
        for other, folder in self._folders.items():
            if other != base:
                with contextlib.suppress(OSError):  # no run can start there then
                    folder.set(robot, source, domain_id, nodes)
        return latch

    def all(self) -> list[Latch]:
        """Every latch; one e-stop may stand at several bases."""
        return [latch for folder in self._folders.values() for latch in folder.all()]

    def clear(self, latch: Latch) -> None:
        """Releases a latch. Raises OSError."""
        for folder in self._folders.values():
            folder.clear(latch)

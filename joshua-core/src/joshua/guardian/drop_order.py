"""The order to drop parking joints at once, from the supervisor of a run to its guardians.

It is a file in the directory of the run, because the driver between them may be dead or hung. The file is
made before the joints get torque and renamed to give the order, which needs no space on the disk.
"""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

_SPARE, _GIVEN = "drop.spare", "drop"


class DropOrder:
    """The order of one run.

    Args:
        folder: of the run's e-stop files; "" for a run without directory, which gives no order.
    """

    def __init__(self, folder: str) -> None:
        self._folder = Path(folder) if folder else None

    def prepare(self) -> None:
        """Makes the spare file. Raises OSError."""
        if self._folder is not None:
            self._folder.mkdir(mode=0o700, exist_ok=True)
            (self._folder / _SPARE).touch(mode=0o600)

    def give(self) -> None:
        """Lets every guardian of the run release joints instead of parking them. Raises OSError."""
        if self._folder is None:
            return
        with contextlib.suppress(FileNotFoundError):
            (self._folder / _SPARE).rename(self._folder / _GIVEN)
            return
        self._folder.mkdir(mode=0o700, exist_ok=True)
        (self._folder / _GIVEN).touch(mode=0o600)

    @property
    def given(self) -> bool:
        """Whether the order was given. Takes microseconds."""
        return self._folder is not None and os.path.exists(self._folder / _GIVEN)  # noqa: PTH110 (hot)

"""Journal of a calibration write: the old and the new values of the servos."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from joshua.api.files import make_private
from pydantic import BaseModel, ConfigDict, ValidationError

from joshua_calibration.arm_file import sync_folder
from joshua_calibration.target import StoredMotor


class Record(BaseModel):
    """Old and new state of one arm.

    Attributes:
        device_identity: of the arm; "" if it has none.
        calibrated_at: of the new calibration; shows whether the file was written.
        old, new: values by motor id.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    node_name: str
    device_identity: str
    calibrated_at: str
    old: dict[int, StoredMotor]
    new: dict[int, StoredMotor]


class JournalRefused(Exception):
    """The journal cannot be read or written. The message gives reason and remedy."""


class Journal:
    """The journal of one arm; it exists while servos and file may disagree.

    Args:
        path: of the journal.
        recovery: the command that recovers the arm.
    """

    def __init__(
        self, path: str | os.PathLike[str], recovery: str = "joshua calibrate --recover --config FILE"
    ) -> None:
        self.path = Path(path)
        self.recovery = recovery

    @property
    def stands(self) -> bool:
        """Whether a calibration write was interrupted."""
        return self.path.exists()

    def read(self) -> Record | None:
        """Return the record; None if there is none. Raises JournalRefused."""
        try:
            return Record.model_validate_json(self.path.read_bytes())
        except (FileNotFoundError, NotADirectoryError):
            return None
        except (OSError, ValidationError) as error:
            raise JournalRefused(
                f"{self.path}: the record of an interrupted calibration cannot be read. Remove it, then "
                "calibrate the arm again"
            ) from error

    def write(self, record: Record) -> None:
        """Write the record durably. Raises JournalRefused."""
        try:
            make_private(self.path.parent)
            handle, name = tempfile.mkstemp(prefix=f".{self.path.name}.", dir=self.path.parent)
            with os.fdopen(handle, "wb") as file:
                file.write(record.model_dump_json(indent=1).encode())
                file.flush()
                os.fsync(handle)
            Path(name).replace(self.path)
            sync_folder(self.path.parent)
        except OSError as error:
            raise JournalRefused(
                f"{self.path}: cannot be written ({error.strerror}); check permissions and space"
            ) from error

    def remove(self) -> None:
        """Remove the journal and its temporary files, because servos and file agree. Idempotent."""
        for left in self.path.parent.glob(f".{self.path.name}.*"):
            left.unlink(missing_ok=True)
        self.path.unlink(missing_ok=True)

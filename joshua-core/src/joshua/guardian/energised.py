"""Records of actuators with torque, beside the runs, because an arm that holds outlives its run.

A driver makes the file before it enables torque, and whoever reads back that torque is off removes it. So a
record also stands after every process was killed. The file moves into place by a rename, and nothing is
written at a stop: a full disk delays none. Light to import.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from joshua.guardian.latch import write_whole

FOLDER_NAME = "energised"

_SUFFIX = ".json"
_SPARE_SUFFIX = ".spare"


def energised_folder(base: Path) -> Path:
    """Folder of the records, beside the runs, which they outlive."""
    return base / FOLDER_NAME


@dataclass(frozen=True)
class EnergisedRecord:
    """An actuator whose torque was enabled and not read back as off since.

    Attributes:
        node: its full name; robot: ``general.id`` of its file; source: the file, absolute.
        domain_id: ROS 2 domain; run: name of its run.
        options: words of the command line that change what the file says.
        implementation: import string of its ``SafeStopRequest``, "" if it has none; request: its values.
        since: local time at which its torque was enabled, "" before.
    """

    node: str
    robot: str
    source: str
    domain_id: int
    run: str
    implementation: str = ""
    request: Mapping[str, Any] = field(default_factory=dict)
    options: tuple[str, ...] = ()
    since: str = ""

    @property
    def file_name(self) -> str:
        """Name of its file: the same for the same actuator of the same robot."""
        robot = hashlib.sha256((self.robot or self.source).encode()).hexdigest()[:12]
        return f"{self.domain_id}{self.node.replace('/', '.')}.{robot}{_SUFFIX}"


class EnergisedFolder:
    """The records of this user on this machine.

    Args:
        path: of the folder; it need not exist.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    def all(self) -> list[EnergisedRecord]:
        """Every record, oldest first. A file that cannot be read is left out."""
        found = [_read(path) for path in self.path.glob(f"*{_SUFFIX}")]
        return sorted((record for record in found if record is not None), key=lambda record: record.since)

    def remove(self, record: EnergisedRecord) -> None:
        """Removes a record. Idempotent. Raises OSError."""
        (self.path / record.file_name).unlink(missing_ok=True)


class EnergisedNote:
    """The record of one actuator, in its driver.

    Args:
        folder: of the records; "" for a run that keeps none, such as one of emulated devices.
        spare_folder: of the run, on the same file system.
        record: of the actuator, without its time.
    """

    def __init__(self, folder: str, spare_folder: str, record: EnergisedRecord) -> None:
        self._record = record
        self._is_energised = False
        self._path = Path(folder) / record.file_name if folder else None
        self._spare = (Path(spare_folder) / record.file_name).with_suffix(_SPARE_SUFFIX)

    @property
    def path(self) -> str:
        """Path of the record, "" if none is kept."""
        return str(self._path or "")

    @property
    def _data(self) -> bytes:
        return json.dumps(asdict(self._record)).encode()

    def prepare(self) -> None:
        """Writes the file beside the run, which leaves an older record as it is. Raises OSError."""
        if self._path is not None:
            self._path.parent.mkdir(mode=0o700, exist_ok=True)
            self._spare.parent.mkdir(mode=0o700, exist_ok=True)
            write_whole(self._spare, self._data)

    def energising(self) -> None:
        """Puts the record in place before torque is enabled. Raises OSError."""
        if self._path is None:
            return
        self._is_energised = True
        with contextlib.suppress(FileNotFoundError):
            os.utime(self._spare)
            self._spare.rename(self._path)
            return
        self._path.parent.mkdir(mode=0o700, exist_ok=True)
        if self._path.exists():  # torque is enabled again
            os.utime(self._path)
        else:
            write_whole(self._path, self._data)

    def keep(self) -> None:
        """Writes the record again if it has vanished with its folder. Raises OSError."""
        if self._path is not None and self._is_energised and not self._path.exists():
            self._path.parent.mkdir(mode=0o700, exist_ok=True)
            write_whole(self._path, self._data)

    def released(self) -> None:
        """Takes the record away, because the device has confirmed that its torque is off. Idempotent."""
        if self._path is None:
            return
        self._is_energised = False
        if not self._spare.exists():
            with contextlib.suppress(OSError):  # the folder of the run has vanished, or there is no record
                self._path.rename(self._spare)  # for the next time
                return
        with contextlib.suppress(OSError):
            self._path.unlink(missing_ok=True)


def remove_record(path: str) -> None:
    """Removes a record by its path, in a guardian. Does its best."""
    if path:
        with contextlib.suppress(OSError):
            os.unlink(path)  # noqa: PTH108 (a guardian imports little)


def _read(path: Path) -> EnergisedRecord | None:
    try:
        values = json.loads(path.read_text())
        since = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(path.stat().st_mtime))
        record = EnergisedRecord(**{**values, "options": tuple(values["options"]), "since": since})
    except (OSError, ValueError, TypeError, KeyError):
        return None
    return record if record.file_name == path.name else None

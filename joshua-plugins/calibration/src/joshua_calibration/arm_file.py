"""The calibration file of a robot; replacing one entry leaves the rest of the text unchanged."""

from __future__ import annotations

import contextlib
import fcntl
import os
import tempfile
import time
from pathlib import Path
from typing import Any

from google.protobuf import text_format
from joshua.api.calibration import ArmCalibration
from joshua.tools import FileRefused, kept_calibrations, spans
from pydantic import ValidationError

LOCK_TIMEOUT_S = 5.0

HEADER = """# Calibration of the arms of one robot, written by joshua.
# Every configuration with its general.id loads it.
# Servos that remember their calibration hold the same values: calibrate again instead of changing them here.
# Only `inverted` is not in the servos: set `inverted: true` for a joint that is mounted in mirror image.

"""


class ArmFile:
    """The calibration file of a robot's arms.

    Args:
        path: of the file; need not exist.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)

    def arm(self, node_name: str) -> ArmCalibration | None:
        """Return the calibration of one arm; None if the file has none.

        Raises:
            FileRefused: the file cannot be read, or its entry is not a valid calibration.
        """
        return _arm(self.path, node_name, self.path)

    def require_writable(self) -> None:
        """Check that the file can be written, before the user does the work. Raises FileRefused."""
        folder = next(path for path in self.path.absolute().parents if path.exists())
        if not folder.is_dir() or not os.access(folder, os.W_OK | os.X_OK):
            why = "is not writable by this user" if folder.is_dir() else "is not a folder"
            raise FileRefused(
                f"{self.path}: the calibration cannot be written there, because {folder} {why}. Correct that"
            )

    def sweep(self) -> None:
        """Remove temporary files of killed runs. Raises FileRefused."""
        target = self.path.resolve()
        if _leftovers(target):
            PreparedFile(target, _take(target)).discard()

    def prepare(self, node_name: str, calibration: ArmCalibration) -> PreparedFile:
        """Write the new content to a temporary file, ready for ``commit``; the folder stays locked.

        Raises:
            FileRefused: the file cannot be read or written, or the new content does not read back equal.
        """
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            target = self.path.resolve()
            prepared = PreparedFile(target, _take(target))
            try:
                text = self._text(node_name, calibration)
                mode = target.stat().st_mode & 0o7777 if target.exists() else 0o644
                handle, name = prepared.make_temporary()
                with os.fdopen(handle, "wb") as file:
                    file.write(text.encode())
                    file.flush()
                    os.fchmod(handle, mode)
                    os.fsync(handle)
                if _arm(Path(name), node_name, self.path) != calibration:
                    raise FileRefused(f"{self.path}: the new entry would not read back as written")
            except BaseException:
                prepared.discard()
                raise
        except OSError as error:
            raise FileRefused(
                f"{self.path}: cannot be written ({error.strerror}); check the permissions of the folder and "
                "the space on the disk"
            ) from error
        return prepared

    def _text(self, node_name: str, calibration: ArmCalibration) -> str:
        entry = calibration.to_block(node_name)
        if not self.path.exists():
            return f"{HEADER}calibration {{\n{_indented(_arms(entry))}}}\n"
        kept_calibrations(self.path)  # never write into an unreadable file
        return _with_arm(self.path.read_text(encoding="utf-8-sig"), entry)


class PreparedFile:
    """New content in a temporary file; the file stays locked until ``commit`` or ``discard``.

    Args:
        target: the file; lock: descriptor of its folder, locked.
    """

    def __init__(self, target: Path, lock: int) -> None:
        self._temporary: Path | None = None
        self._target = target
        self._lock = lock

    def make_temporary(self) -> tuple[int, str]:
        """Create the temporary file; remove those of killed runs."""
        self._sweep()
        handle, name = tempfile.mkstemp(
            prefix=f".{self._target.name}.", suffix=".new", dir=self._target.parent
        )
        self._temporary = Path(name)
        return handle, name

    def commit(self) -> None:
        """Replace the file atomically. Raises FileRefused; then nothing changed."""
        assert self._temporary is not None
        try:
            self._temporary.replace(self._target)
        except OSError as error:
            self.discard()
            raise FileRefused(f"{self._target}: cannot be replaced ({error.strerror})") from error
        self._let_go()
        with contextlib.suppress(OSError):  # the content is in place, though perhaps not durable yet
            sync_folder(self._target.parent)

    def discard(self) -> None:
        """Remove the new content and the temporary files of killed runs; no effect after ``commit``."""
        if self._lock >= 0:
            self._sweep()
        self._let_go()

    def _sweep(self) -> None:
        for left in _leftovers(self._target):
            with contextlib.suppress(OSError):  # the cause also made the write fail, and was reported then
                left.unlink()

    def _let_go(self) -> None:
        lock, self._lock = self._lock, -1
        if lock >= 0:
            os.close(lock)


def _leftovers(target: Path) -> list[Path]:
    return list(target.parent.glob(f".{target.name}.*.new"))


def _take(target: Path) -> int:
    """Lock the folder of a file so two runs do not overwrite each other's entries."""
    lock = os.open(target.parent, os.O_RDONLY | os.O_CLOEXEC)
    deadline_s = time.monotonic() + LOCK_TIMEOUT_S
    while True:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() > deadline_s:
                os.close(lock)
                raise FileRefused(
                    f"{target}: another program is writing into its folder. Wait until it has finished"
                ) from None
            time.sleep(0.02)
        else:
            return lock


def sync_folder(folder: Path) -> None:
    """Sync a folder to disk, so its names survive a power cut. Raises OSError."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _arm(read: Path, node_name: str, path: Path) -> ArmCalibration | None:
    """Return the entry of an arm in the parsed file ``read``; ``path`` is for messages."""
    block = kept_calibrations(read).get(node_name)
    if block is None:
        return None
    try:
        return ArmCalibration.from_block(block)
    except ValidationError as error:
        detail = error.errors(include_url=False)[0]
        reason = detail["msg"].removeprefix("Value error, ")
        raise FileRefused(
            f"{path}: the calibration of {node_name} cannot be used: {reason}. "
            "Calibrate the arm again, or correct the file"
        ) from error


def _with_arm(text: str, entry: Any) -> str:
    """Return the text with one arm's entry replaced, or added to the first calibration block or at the end.

    Args:
        entry: block of the arm.
    """
    new = _indented(_arms(entry))
    for start, end in spans(text, "calibration.arms"):
        if _node_name(text[start + 1 : end - 1], type(entry)) == entry.node_name:
            return text[:start] + new.strip().removeprefix("arms ") + text[end:]
    blocks = spans(text, "calibration")
    if not blocks:
        return f"{text.rstrip()}\n\ncalibration {{\n{new}}}\n".lstrip("\n")
    end = blocks[0][1] - 1
    return f"{text[:end].rstrip()}\n{new}{text[end:]}"


def _node_name(text: str, kind: Any) -> str:
    for start, end in spans(text, "node_name"):
        return str(text_format.Parse(f"node_name: {text[start:end]}", kind()).node_name)
    return ""


def _arms(entry: Any) -> str:
    return f"arms {{\n{_indented(text_format.MessageToString(entry))}}}"


def _indented(text: str) -> str:
    return "".join(f"  {line}\n" for line in text.splitlines())

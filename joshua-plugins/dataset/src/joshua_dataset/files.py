"""The text of errors of a disk, and the places of a data set's own files."""

from __future__ import annotations

import contextlib
import errno
import io
import os
import shutil
from pathlib import Path
from typing import Any

from joshua.api.files import Files as Files
from joshua.api.files import inside, remedy

from joshua_dataset.lock import PRIVATE


def reason(error: Exception) -> str:
    """Return the text of an error, with what to do about the disk."""
    found = remedy(error)
    return f"{error}. {found}" if found else str(error)


def cause(error: Exception) -> str:
    """Return the text of an error without its remedy, for messages that end with a command."""
    return str(getattr(error, "strerror", None) or error)


def remedy_first(error: Exception, then: str) -> str:
    """Return what to do about the disk, and what after that, in one sentence.

    Args:
        then: an imperative, such as ``run the command again``.
    """
    found = remedy(error)
    return f"{found}, then {then}" if found else f"{then[0].upper()}{then[1:]}"


def aside_folder(folder: Path) -> Path:
    """Return the folder of what could not be mended in a data set; no command removes anything from it.

    Raises:
        UnsafePathError: it is elsewhere.
    """
    return inside(folder, Path(PRIVATE) / "aside", "the folder of what was moved aside")


def linked(source: str | Path, target: str | Path) -> None:
    """Give a file a second name, or copy it where the disk has no links. Raises OSError."""
    try:
        if Path(source).is_symlink():
            raise OSError(errno.EMLINK, "a link to a link would lead elsewhere", str(source))
        os.link(source, target)
    except OSError:
        shutil.copyfile(source, target)


def remove_empty_folders(top: Path) -> None:
    """Remove the empty folders below a folder of a data set; what contains a file stays."""
    if top.is_symlink():
        return
    for place, _, _ in os.walk(top, topdown=False):
        if Path(place) != top:
            with contextlib.suppress(OSError):  # it is not empty
                Path(place).rmdir()


class PatientFile(io.RawIOBase):
    """New file whose content waits in memory while the disk refuses it, so that no codec sees the error.

    Its user looks at ``error`` after each write, ends soon, and calls ``push`` when there is space again.

    Args:
        path: of the file.

    Attributes:
        error: of the disk; None while everything is written.

    Raises:
        OSError: the file cannot be created.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_TRUNC, 0o666)
        self._position = self._size = 0
        self._waiting: list[tuple[int, bytes]] = []
        self.error: OSError | None = None

    def writable(self) -> bool:
        """See ``io.IOBase``."""
        return True

    def seekable(self) -> bool:
        """See ``io.IOBase``."""
        return True

    def write(self, data: Any) -> int:
        """Write at the position; what the disk refuses waits, and what follows it."""
        content = bytes(data)
        self._waiting.append((self._position, content))
        self._position += len(content)
        self._size = max(self._size, self._position)
        if self.error is None:
            try:
                self.push()
            except OSError as error:
                self.error = error
        return len(content)

    def push(self) -> None:
        """Write what waits, in order. Raises OSError; what is not written waits on."""
        while self._waiting:
            position, content = self._waiting[0]
            count = os.pwrite(self._descriptor, content, position)
            if count < len(content):
                self._waiting[0] = (position + count, content[count:])
            else:
                self._waiting.pop(0)
        self.error = None

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """See ``io.IOBase``."""
        base = {os.SEEK_SET: 0, os.SEEK_CUR: self._position, os.SEEK_END: self._size}[whence]
        self._position = base + offset
        return self._position

    def tell(self) -> int:
        """See ``io.IOBase``."""
        return self._position

    def close(self) -> None:
        """Close the file; what waits is dropped."""
        if not self.closed:
            os.close(self._descriptor)
        super().close()

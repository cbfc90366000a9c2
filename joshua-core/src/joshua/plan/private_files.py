"""Files and folders that only their owner can read, whatever the umask is."""

from __future__ import annotations

import errno
import os
from pathlib import Path

#: Modes of a private file and a private folder.
FILE_MODE, FOLDER_MODE = 0o600, 0o700


def make_private(folder: Path) -> None:
    """Create a folder and its missing parents, private each; existing ones stay as they are. Idempotent.

    Raises:
        OSError: one cannot be created.
    """
    if folder.is_dir():
        return
    if folder.parent != folder:
        make_private(folder.parent)
    try:
        folder.mkdir(FOLDER_MODE)
    except FileExistsError as error:
        if not folder.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(folder)) from error
        return  # another process created it meanwhile
    folder.chmod(FOLDER_MODE)  # the umask may have removed bits of the owner


def private_opener(path: str, flags: int) -> int:
    """Open a file for ``open(…, opener=private_opener)``; a new one is private, others keep their mode.

    Raises:
        OSError: as ``os.open``.
    """
    return os.open(path, flags | os.O_CLOEXEC, FILE_MODE)


def create_private(path: Path) -> None:
    """Create an empty private file, for a library that opens it by name; an existing one becomes private.

    Raises:
        OSError: it cannot be created.
    """
    with open(path, "ab", opener=private_opener):
        path.chmod(FILE_MODE)

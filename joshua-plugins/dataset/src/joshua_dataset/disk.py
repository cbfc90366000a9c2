"""The disk of a recording: whether it can be written, and its free space."""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path

from joshua.api import RefusedError

from joshua_dataset.files import reason

#: Space on the disk below which no episode starts, and below which one ends.
LEAST_FREE_BYTES = 500 << 20


def free_bytes(folder: Path) -> int:
    """Return the free space of the disk of a folder, which may not exist yet; 0 if the disk is lost."""
    try:
        return shutil.disk_usage(_existing(folder)).free
    except OSError:
        return 0


def shortage(folder: Path) -> str:
    """Return why an open episode must end; "" if it can continue."""
    free = free_bytes(folder)
    if not free:
        return "the disk is full or lost: free some space, or check its cable"
    return "the disk is almost full: free some space" if free < LEAST_FREE_BYTES else ""


def require_space(folder: Path) -> None:
    """Raise RefusedError if the disk of a folder cannot take an episode."""
    try:
        with tempfile.TemporaryFile(dir=_existing(folder)):  # a disk with errors may only seem writable
            pass
    except OSError as error:
        raise RefusedError(f"{folder} cannot be written: {reason(error)}") from error
    free = free_bytes(folder)
    if free < LEAST_FREE_BYTES:
        raise RefusedError(
            f"the disk of {folder} has {free >> 20} MB left; "
            f"free some space, at least {LEAST_FREE_BYTES >> 20} MB"
        )


def _existing(folder: Path) -> Path:
    return next((path for path in (folder, *folder.parents) if os.path.exists(path)), folder)  # noqa: PTH110

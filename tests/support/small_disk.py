"""A small file system of a test's own, which becomes full, read-only or empty."""

from __future__ import annotations

import contextlib
import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

BLOCK_BYTES = 4096


class SmallDisk:
    """A mounted tmpfs.

    Args:
        path: its mount point.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._filler = path / "filler"

    def fill(self) -> None:
        """Takes every byte and every inode: then no file can be created, and none can grow."""
        self._filler.mkdir()
        with contextlib.suppress(OSError), (self._filler / "bytes").open("wb", buffering=0) as file:
            while True:
                file.write(bytes(BLOCK_BYTES))
        with contextlib.suppress(OSError):
            for number in range(1_000_000):
                os.close(os.open(self._filler / str(number), os.O_CREAT | os.O_WRONLY))
        status = os.statvfs(self.path)
        assert (status.f_bavail, status.f_favail) == (0, 0)

    def free(self) -> None:
        """Gives the space back."""
        for path in self._filler.iterdir():
            path.unlink()
        self._filler.rmdir()

    def make_read_only(self) -> None:
        """Makes every path below read-only. Open files can still be written, as after an error of a disk."""
        _mount("--bind", str(self.path), str(self.path))
        _mount("-o", "remount,bind,ro", str(self.path))

    def make_writable(self) -> None:
        """Undoes ``make_read_only``."""
        subprocess.run(["umount", str(self.path)], check=True)


@contextmanager
def small_disk(path: Path, size_bytes: int = 8 * 1024 * 1024, inodes: int = 2000) -> Iterator[SmallDisk]:
    """Mounts a tmpfs at a folder. Skips the test where this user must not mount."""
    path.mkdir()
    try:
        _mount(
            "-t", "tmpfs", "-o", f"size={size_bytes},nr_inodes={inodes},mode=0700", "joshua-test", str(path)
        )
    except (OSError, subprocess.CalledProcessError) as error:
        pytest.skip(f"NOT TESTED: this user cannot mount a tmpfs ({error}). Run the test as root")
    try:
        yield SmallDisk(path)
    finally:
        while path.is_mount():
            subprocess.run(["umount", "-l", str(path)], check=True)


def _mount(*arguments: str) -> None:
    subprocess.run(["mount", *arguments], check=True, capture_output=True)

"""Find the processes that have a device open, as far as Linux shows them to this user."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path


def holders(path: str, proc: Path = Path("/proc")) -> list[int]:
    """Return the processes that have locked a device, or else those that have it open.

    Args:
        proc: the proc file system.
    """
    try:
        status = os.stat(path)  # noqa: PTH116 - follows links like open does
    except OSError:
        return []  # unplugged meanwhile
    number = f"{os.major(status.st_dev):02x}:{os.minor(status.st_dev):02x}:{status.st_ino}"
    with contextlib.suppress(OSError, ValueError):
        rows = [line.split() for line in (proc / "locks").read_text(encoding="ascii").splitlines()]
        if locking := [int(row[4]) for row in rows if row[1] == "FLOCK" and row[5] == number]:
            return locking
    device = str(Path(path).resolve())
    found = []
    for folder in proc.glob("[0-9]*/fd"):
        with contextlib.suppress(OSError):
            if any(os.readlink(link) == device for link in folder.iterdir()):  # noqa: PTH115 - a link to a name
                found.append(int(folder.parent.name))
    return [process for process in found if process != os.getpid()]


def describe_process(process: int, proc: Path = Path("/proc")) -> str:
    """Name a process for people, such as ``minicom (process 4711)``."""
    folder = proc / str(process)
    with contextlib.suppress(OSError):
        name = (folder / "comm").read_text(encoding="utf-8").strip()
        if process == os.getpid():
            return f"{name} (process {process}, this one)"
        words = (folder / "cmdline").read_bytes().decode(errors="replace").split("\0")
        if _is_run(words):
            return f"{name} (process {process}) of a run that `joshua stop` ends"
        return f"{name} (process {process})"
    return f"process {process}"


def is_guardian(process: int, proc: Path = Path("/proc")) -> bool:
    """Return whether a process is a guardian that brings a device into its safe state."""
    with contextlib.suppress(OSError):
        return (proc / str(process) / "comm").read_bytes().strip() == b"joshua-guardian"
    return False


def _is_run(words: list[str]) -> bool:
    """Return whether a command line starts nodes, that is, has options but no command."""
    for index, word in enumerate(words[:-1]):
        if Path(word).name == "joshua" or word == "joshua.cli.main":
            return words[index + 1].startswith("-")
    return False

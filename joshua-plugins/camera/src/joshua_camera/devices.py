"""The video devices of this machine: paths, names, stable links, and the processes that use them."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from joshua_camera.source_text import BY_ID_FOLDER

_NUMBERED = re.compile(r"video(\d+)")


@dataclass(frozen=True)
class DeviceEntry:
    """One video device as listed by the system; the device is not opened.

    Attributes:
        index: N of /dev/videoN.
        path: such as ``/dev/video0``.
        name: of the camera, as reported by the system; "" if unknown.
        by_id: names under /dev/v4l/by-id that link to it.
    """

    index: int
    path: str
    name: str
    by_id: tuple[str, ...]


def list_devices(root: Path = Path("/")) -> list[DeviceEntry]:
    """List the video devices in ascending order of index.

    Args:
        root: folder that holds ``dev`` and ``sys``.
    """
    folder = root / "dev"
    links = _stable_names(root)
    entries = []
    for path in folder.glob("video*"):
        match = _NUMBERED.fullmatch(path.name)
        if match is None:
            continue
        label = root / "sys/class/video4linux" / path.name / "name"
        try:
            name = label.read_text(encoding="utf-8", errors="replace").strip()
        except OSError:
            name = ""
        by_id = tuple(sorted(links.get(path.name, ())))
        entries.append(DeviceEntry(int(match[1]), str(path), name, by_id))
    return sorted(entries, key=lambda entry: entry.index)


def _stable_names(root: Path) -> dict[str, list[str]]:
    """Return the names under by-id, by the name of the device that they link to."""
    found: dict[str, list[str]] = {}
    folder = root / BY_ID_FOLDER.lstrip("/")
    try:
        links = list(folder.iterdir())
    except OSError:
        return found
    for link in links:
        try:
            target = os.readlink(link)  # noqa: PTH115 - the text of the link, wherever the root lies
        except OSError:
            continue
        found.setdefault(Path(target).name, []).append(link.name)
    return found


def holders(path: str, proc: Path = Path("/proc")) -> list[str]:
    """Return the other processes that have a device open, such as ``firefox (process 4711)``.

    Only the administrator sees other users' processes, so an empty list proves nothing.
    """
    real = os.path.realpath(path)
    return [
        f"{_process_name(folder)} (process {folder.name})"
        for folder in sorted(_processes(proc), key=lambda folder: int(folder.name))
        if folder.name != str(os.getpid()) and _has_open(folder, real)
    ]


def _processes(proc: Path) -> Iterator[Path]:
    try:
        yield from (folder for folder in proc.iterdir() if folder.name.isdigit())
    except OSError:
        return


def _has_open(process: Path, path: str) -> bool:
    try:
        for descriptor in os.listdir(process / "fd"):  # noqa: PTH208 - names only
            if os.readlink(process / "fd" / descriptor) == path:  # noqa: PTH115 - a descriptor's link
                return True
    except OSError:  # another user's process, or one that has ended
        return False
    return False


def _process_name(process: Path) -> str:
    try:
        return (process / "comm").read_text(encoding="utf-8", errors="replace").strip() or "?"
    except OSError:
        return "?"

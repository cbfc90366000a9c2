"""The video devices of this machine: paths, names, stable links, and the processes that use them."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from joshua_camera.source_text import BY_ID_FOLDER, BY_PATH_FOLDER

_NUMBERED = re.compile(r"video(\d+)")


@dataclass(frozen=True)
class DeviceEntry:
    """One video device as listed by the system; the device is not opened.

    Attributes:
        index: N of /dev/videoN.
        path: such as ``/dev/video0``.
        name: of the camera, as reported by the system; "" if unknown.
        by_id: names under /dev/v4l/by-id that link to it: the camera, in any socket.
        by_path: names under /dev/v4l/by-path that link to it: the socket, whatever is plugged in.
        usb: vendor, product and serial number of its USB device; () if unknown.
    """

    index: int
    path: str
    name: str
    by_id: tuple[str, ...]
    by_path: tuple[str, ...] = ()
    usb: tuple[str, ...] = ()

    def is_twin_of(self, other: DeviceEntry) -> bool:
        """Whether both are of one model and serial number, so that udev names only one of them by its id."""
        return self.index != other.index and (self.name, self.usb) == (other.name, other.usb)


def ambiguous_ids(entries: Sequence[DeviceEntry]) -> set[int]:
    """Return the indexes of the devices whose name under by-id may also mean another camera, or is missing.

    udev keeps one link where two cameras have the same model and serial number. It means the one that was
    plugged in last.
    """
    found: set[int] = set()
    for entry in entries:
        if entry.by_id:
            # One with neither name is not a camera that udev has seen.
            twins = [
                other for other in entries if entry.is_twin_of(other) and other.by_path and not other.by_id
            ]
            found.update(other.index for other in twins)
            if twins:
                found.add(entry.index)
    return found


def list_devices(root: Path = Path("/")) -> list[DeviceEntry]:
    """List the video devices in ascending order of index.

    Args:
        root: folder that holds ``dev`` and ``sys``.
    """
    folder = root / "dev"
    by_id, by_path = (_links(root, place) for place in (BY_ID_FOLDER, BY_PATH_FOLDER))
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
        entry = DeviceEntry(
            int(match[1]),
            str(path),
            name,
            tuple(sorted(by_id.get(path.name, ()))),
            tuple(sorted(by_path.get(path.name, ()))),
            _usb_identity(root, path.name),
        )
        entries.append(entry)
    return sorted(entries, key=lambda entry: entry.index)


def _usb_identity(root: Path, name: str) -> tuple[str, ...]:
    """Return vendor, product and serial number of the USB device behind a video device; () without one."""
    device = (root / "sys/class/video4linux" / name / "device").resolve()
    for folder in (device, *device.parents):
        if (folder / "idVendor").is_file():
            return tuple(_read(folder / fact) for fact in ("idVendor", "idProduct", "serial"))
    return ()


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return ""


def _links(root: Path, place: str) -> dict[str, list[str]]:
    """Return the names of udev's links in a folder, by the name of the device that they link to."""
    found: dict[str, list[str]] = {}
    folder = root / place.lstrip("/")
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

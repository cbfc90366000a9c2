"""A survey of this machine's cameras: identity, modes, and a picture of each."""

from __future__ import annotations

import sys
from collections.abc import Container, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from joshua.api import DeviceError

from joshua_camera import v4l2
from joshua_camera.camera import OpenCvCamera
from joshua_camera.device_errors import explain_device
from joshua_camera.devices import DeviceEntry, ambiguous_ids, list_devices
from joshua_camera.opencv import load_opencv
from joshua_camera.settings import CameraSettings

#: Pictures until the automatic exposure settles.
SETTLING_PICTURES = 10
PICTURE_TIMEOUT_S = 2.0

#: A size and a rate that nearly every camera has.
USUAL_SIZE = (640, 480)
USUAL_FPS = 30
MAC_DEVICES = 8


@dataclass(frozen=True)
class FoundCamera:
    """One camera.

    Attributes:
        path: of its device; name: as reported by the system; "" if unknown.
        index: for ``device_id``; source: stable name for ``source``, "" if it has none.
        note: what to know about that name; "" for nothing.
        formats: that it reports.
        picture: path of the saved picture; "" if there is none.
        problem: why it cannot be used, with the remedy; "" if it can.
    """

    path: str
    name: str
    index: int
    source: str = ""
    note: str = ""
    formats: tuple[v4l2.PixelFormat, ...] = ()
    picture: str = ""
    problem: str = ""


def survey(folder: Path | None = None, root: Path = Path("/")) -> list[FoundCamera]:
    """Survey every camera.

    Args:
        folder: where a picture of each is saved; None takes none.
        root: folder that contains ``dev`` and ``sys``.

    Raises:
        OSError: a picture cannot be written.
    """
    found = list(_on_linux(root) if sys.platform == "linux" else _by_index())
    return found if folder is None else [_with_picture(camera, folder) for camera in found]


def _on_linux(root: Path) -> Iterator[FoundCamera]:
    entries = list_devices(root)
    ambiguous = ambiguous_ids(entries)
    for entry in entries:
        camera = FoundCamera(entry.path, entry.name, entry.index, *_stable_name(entry, ambiguous))
        try:
            with v4l2.open_device(entry.path) as device:
                capability = device.capability()
                if not capability.captures:
                    continue  # the metadata node of a camera that has a capture node
                formats = tuple(device.formats())
        except OSError as error:
            yield replace(camera, problem=str(explain_device(entry.path, error)))
            continue
        yield replace(camera, name=entry.name or capability.card, formats=formats)


def _stable_name(entry: DeviceEntry, ambiguous: Container[int]) -> tuple[str, str]:
    """Return the name that means this camera at every start, and what to know about it."""
    if entry.by_id and entry.index not in ambiguous:
        return entry.by_id[0], ""
    if not entry.by_path:
        return "", ""
    note = "this name means its USB socket: plug the camera into the same socket each time"
    if entry.index in ambiguous:
        note = (
            f"another camera has the same model and serial number, so their by-id name is ambiguous; {note}"
        )
    return entry.by_path[0], note


def _by_index() -> Iterator[FoundCamera]:
    """Yield the cameras that open; systems other than Linux offer no list."""
    cv2 = load_opencv()
    for index in range(MAC_DEVICES):
        video = cv2.VideoCapture(index)
        if video.isOpened():
            yield FoundCamera(f"camera {index}", "", index)
        video.release()


def _with_picture(camera: FoundCamera, folder: Path) -> FoundCamera:
    if camera.problem:
        return camera
    width, height, fps, code = _mode(camera)
    settings = CameraSettings(
        device_id=camera.index,
        width=width,
        height=height,
        fps=fps,
        pixel_format=code,
        source="",
        intrinsics_file="",
        display=False,
    )
    device = OpenCvCamera(settings)
    try:
        device.connect()
        reading = None
        for _ in range(SETTLING_PICTURES):
            reading = device.read(PICTURE_TIMEOUT_S) or reading
    except DeviceError as error:
        return replace(camera, problem=str(error))
    finally:
        device.disconnect()
    if reading is None:
        return replace(camera, problem=f"{camera.path} delivered no picture")
    path = folder / f"{Path(camera.path).name.replace(' ', '_')}.jpg"
    path.write_bytes(reading.data.as_jpeg())
    return replace(camera, picture=str(path))


def _mode(camera: FoundCamera) -> tuple[int, int, int, str]:
    """Return width, height, rate and format for a picture: common values, else the camera's first ones."""
    formats = sorted(camera.formats, key=lambda entry: entry.code != "MJPG")
    for entry in formats:
        for size in sorted(entry.sizes, key=lambda size: (size.width, size.height) != USUAL_SIZE):
            rates = [rate for rate in size.rates_hz if rate >= 1] or [float(USUAL_FPS)]
            fps = min(rates, key=lambda rate: abs(rate - USUAL_FPS))
            return size.width, size.height, round(fps), entry.code
    return (*USUAL_SIZE, USUAL_FPS, "MJPG")

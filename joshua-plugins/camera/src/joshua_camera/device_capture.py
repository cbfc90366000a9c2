"""A camera of this machine: V4L2 on Linux, AVFoundation on macOS."""

from __future__ import annotations

import contextlib
import sys
from typing import Any

from joshua_camera import v4l2
from joshua_camera.capture import Capture
from joshua_camera.controls import Applied, apply_controls, apply_format, describe, exposure_text
from joshua_camera.device_errors import explain_device, others
from joshua_camera.interrupt import descriptors_of

_NS_PER_MS = 1_000_000
_OLDEST_NS = 5_000_000_000  # an older stamp is from another clock
_JPEG_CODES = ("MJPG", "JPEG")


class DeviceCapture(Capture):
    """A camera of this machine. On Linux, pictures carry the driver's acquisition time."""

    def open(self) -> None:
        """Open the device and apply the settings. Raises DeviceError."""
        cv2 = self._load()
        video = self._video = cv2.VideoCapture()
        if sys.platform == "linux":
            self._check_device()
            opened = video.open(self.source.target, cv2.CAP_V4L2)
        else:
            opened = self.source.index is not None and video.open(self.source.index, cv2.CAP_AVFOUNDATION)
        if not opened:
            raise self._refuse(
                "cannot be opened",
                "joshua find-cameras lists the cameras; on macOS, allow the terminal to use the camera",
            )
        self._apply(cv2, video)
        self.has_own_clock = sys.platform == "linux"

    def interrupt(self) -> None:
        """End the stream, which wakes a wait for the next picture."""
        self._interrupted.set()
        for descriptor in descriptors_of(self.source.target):
            # The device may be gone, or closed by the capture thread in the meantime.
            with contextlib.suppress(OSError):
                v4l2.stop_stream(descriptor)

    def exposure(self) -> str:
        """Return the present exposure as text."""
        units = self._video.get(self._cv2.CAP_PROP_EXPOSURE)
        # OpenCV reports 0 or -1 for a device without this control; other systems use negative logarithms.
        return "" if sys.platform == "linux" and units <= 0 else exposure_text(units)

    def pixel_format(self) -> str:
        """Return the four-character code of the device's pictures."""
        return v4l2.fourcc_text(int(self._video.get(self._cv2.CAP_PROP_FOURCC)))

    def _acquired_ns(self, ended_ns: int) -> int:
        device_ns = int(self._video.get(self._cv2.CAP_PROP_POS_MSEC) * _NS_PER_MS)
        return device_ns if 0 <= ended_ns - device_ns < _OLDEST_NS else ended_ns

    def _apply(self, cv2: Any, video: Any) -> None:
        applied = apply_format(cv2, video, self.settings)
        size = applied[1]
        if not size.kept:
            raise self._refuse(
                f"does not offer {size.asked}, but delivers {size.found}",
                f"set width and height to a size that it offers: {self._sizes()}",
            )
        if applied[0].found in _JPEG_CODES:
            self.delivers_jpeg = bool(video.set(cv2.CAP_PROP_CONVERT_RGB, 0))
        applied += apply_controls(cv2, video, self.settings)
        self._warn([entry for entry in applied if not entry.kept])

    def _warn(self, refused: list[Applied]) -> None:
        if not refused:
            return
        with contextlib.ExitStack() as stack:
            device: v4l2.VideoDevice | None = None
            with contextlib.suppress(OSError):
                device = stack.enter_context(v4l2.open_device(self.source.target))
            self.refused += [describe(entry, device) for entry in refused]

    def _sizes(self) -> str:
        """Return the sizes of the requested pixel format, or else of all formats."""
        try:
            with v4l2.open_device(self.source.target) as device:
                formats = device.formats()
        except OSError:
            return "joshua find-cameras lists them"
        asked = [entry for entry in formats if entry.code == self.settings.pixel_format.rstrip()]
        sizes = dict.fromkeys(
            f"{size.width} × {size.height}" for entry in asked or formats for size in entry.sizes
        )
        return ", ".join(sizes) or "joshua find-cameras lists them"

    def _check_device(self) -> None:
        path = self.source.target
        try:
            with v4l2.open_device(path) as device:
                captures = device.capability().captures
                if captures:
                    device.check_free()
        except OSError as error:
            raise explain_device(path, error) from error
        if not captures:
            raise self._refuse(
                "delivers no pictures",
                f"a camera may have more device files, for metadata; {others(path)}",
            )

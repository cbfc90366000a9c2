"""One open camera behind OpenCV: the base class of all kinds of sources."""

from __future__ import annotations

import threading
import time
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from joshua.api import DeviceError

from joshua_camera.jpeg import inspect_jpeg
from joshua_camera.opencv import load_opencv
from joshua_camera.picture import Picture
from joshua_camera.settings import CameraSettings
from joshua_camera.source import CameraSource


@dataclass(frozen=True)
class Grab:
    """One unmodified picture.

    Attributes:
        began_ns, ended_ns: when the wait for it began and ended, monotonic clock.
        slept_ns: how long this thread slept in between, without decoding.
        acquired_ns: acquisition time, monotonic clock; from the device if it reports one, else ``ended_ns``.
        picture: None if the picture is damaged.
        width, height: of the picture, in pixels; 0 if it is damaged.
    """

    began_ns: int
    ended_ns: int
    slept_ns: int
    acquired_ns: int
    picture: Picture | None = None
    width: int = 0
    height: int = 0


class Capture(ABC):
    """A camera that one thread opens, reads and closes. Only ``interrupt`` is thread-safe.

    Attributes:
        has_own_clock: whether pictures carry the device's acquisition time.
        delivers_jpeg: whether pictures arrive as JPEG files, which are decoded only when pixels are needed.
        refused: settings that the camera did not apply; notes: settings that have no effect on it.
    """

    has_own_clock = False

    def __init__(self, source: CameraSource, settings: CameraSettings) -> None:
        self.source = source
        self.settings = settings
        self.delivers_jpeg = False
        self.refused: list[str] = []
        self.notes: list[str] = []
        self._cv2: Any = None
        self._video: Any = None
        self._interrupted = threading.Event()

    @abstractmethod
    def open(self) -> None:
        """Open the camera and apply the settings. Raises DeviceError."""

    @abstractmethod
    def interrupt(self) -> None:
        """Abort a wait inside ``open`` or ``grab`` as soon as the system allows. Thread-safe."""

    def grab(self) -> Grab | None:
        """Wait for the next picture; None at the end of the stream or after ``interrupt``."""
        began_ns, worked_ns = time.monotonic_ns(), time.thread_time_ns()
        if self._interrupted.is_set() or not self._video.grab():
            return None
        ended_ns = time.monotonic_ns()
        slept_ns = ended_ns - began_ns - (time.thread_time_ns() - worked_ns)
        return self._finish(Grab(began_ns, ended_ns, slept_ns, self._acquired_ns(ended_ns)))

    def exposure(self) -> str:
        """Return the present exposure as text; "" if the camera does not report it."""
        return ""

    def pixel_format(self) -> str:
        """Four-character code of the camera's pictures; "" if unknown."""
        return "JPEG" if self.delivers_jpeg else ""

    def close(self) -> None:
        """Close the camera. Idempotent."""
        if self._video is not None:
            self._video.release()
            self._video = None

    def _load(self) -> Any:
        self._cv2 = load_opencv()
        return self._cv2

    def _acquired_ns(self, ended_ns: int) -> int:
        return ended_ns

    def _refuse(self, problem: str, remedy: str) -> DeviceError:
        return DeviceError(f"{self.source.label} {problem}: {remedy}")

    def _finish(self, grab: Grab) -> Grab:
        """Retrieve the grabbed picture."""
        done, data = self._video.retrieve()
        if not done or data is None or not data.size:
            return grab
        if not self.delivers_jpeg:
            rgb = self._rgb(data)
            return replace(grab, picture=Picture(rgb=rgb), width=rgb.shape[1], height=rgb.shape[0])
        jpeg = data.tobytes()
        facts = inspect_jpeg(jpeg)
        if facts is None:
            return grab
        picture = Picture(jpeg=jpeg[: facts.length])
        return replace(grab, picture=picture, width=facts.width, height=facts.height)

    def _rgb(self, data: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
        grey = data.ndim == 2 or data.shape[2] == 1
        pixels: npt.NDArray[np.uint8] = self._cv2.cvtColor(
            data, self._cv2.COLOR_GRAY2RGB if grey else self._cv2.COLOR_BGR2RGB
        )
        return pixels

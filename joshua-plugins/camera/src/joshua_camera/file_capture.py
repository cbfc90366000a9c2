"""A video file or numbered pictures in place of a camera, at the configured rate."""

from __future__ import annotations

import re
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from joshua.api import DeviceError
from joshua.tools import describe_pointer

from joshua_camera.capture import Capture, Grab
from joshua_camera.settings import CameraSettings
from joshua_camera.source import CameraSource
from joshua_camera.source_text import SourceKind

_NS_PER_S = 1_000_000_000


class FileCapture(Capture):
    """Plays a file in a loop at a fixed rate, like a camera."""

    def __init__(self, source: CameraSource, settings: CameraSettings) -> None:
        super().__init__(source, settings)
        self._period_ns = _NS_PER_S / settings.fps
        self._start_ns = 0
        self._next = 0

    def open(self) -> None:
        """Open the file. Raises DeviceError."""
        self._load()
        self._video = self._start()
        rate = self._video.get(self._cv2.CAP_PROP_FPS)
        # Pictures have no rate of their own; OpenCV then reports 0 or 1.
        if self.source.kind is SourceKind.FILE and rate > 1 and round(rate) != self.settings.fps:
            self.notes.append(
                f"{self.source.label} was recorded at {rate:g} Hz and is played at {self.settings.fps} Hz"
            )
        self._start_ns = time.monotonic_ns()

    def interrupt(self) -> None:
        """Abort the wait for the next picture."""
        self._interrupted.set()

    def grab(self) -> Grab | None:
        """Wait until the next picture is due."""
        began_ns = time.monotonic_ns()
        due_ns = self._start_ns + round(self._next * self._period_ns)
        if self._interrupted.wait(max(0, due_ns - began_ns) / _NS_PER_S):
            return None
        late = int((time.monotonic_ns() - due_ns) / self._period_ns)  # whole periods were missed: a stall
        self._next += 1 + max(0, late)
        if not self._video.grab() and not self._rewind():
            return None
        ended_ns = time.monotonic_ns()
        return self._finish(Grab(began_ns, ended_ns, 0, ended_ns))

    def _rewind(self) -> bool:
        self._video.release()
        self._video = self._start()
        return bool(self._video.grab())

    def _start(self) -> Any:
        cv2, target = self._cv2, self.source.target
        video = cv2.VideoCapture()
        if self.source.kind is SourceKind.PICTURES:
            if video.open(target, cv2.CAP_IMAGES):
                return video
            self._refuse_pointers(_pictures(target))
            raise self._refuse(
                "matches no picture",
                "number the pictures from 0 or 1 without gaps, and use a pattern with the same number of "
                "digits, such as pictures/%04d.jpg",
            )
        if not Path(target).is_file():
            raise self._refuse("does not exist", "correct the path in source")
        if video.open(target, cv2.CAP_FFMPEG, [cv2.CAP_PROP_N_THREADS, 1]):
            return video
        self._refuse_pointers([Path(target)])
        raise self._refuse("is not a readable video file", "convert it, for example to H.264 in an mp4 file")

    def _refuse_pointers(self, paths: Iterable[Path]) -> None:
        """Raise DeviceError if one of the files is a Git LFS pointer."""
        for path in paths:
            pointer = describe_pointer(path)
            if pointer is not None:
                message, remedy = pointer
                raise DeviceError(f"{message}: {remedy[0].lower()}{remedy[1:]}")


def _pictures(pattern: str) -> list[Path]:
    """The files of numbered pictures, in their order.

    Args:
        pattern: path with the place of the number, such as ``pictures/%04d.jpg``.
    """
    path = Path(pattern)
    literal = map(re.escape, re.split(r"%\d*d", path.name))
    name = re.compile(r"\d+".join(literal))
    if not path.parent.is_dir():
        return []
    return sorted(item for item in path.parent.iterdir() if name.fullmatch(item.name))

"""H.264 in MP4 files: every second picture stands alone, so that any frame is found fast."""

from __future__ import annotations

import contextlib
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import numpy.typing as npt

CODEC = "h264"
PIXEL_FORMAT = "yuv420p"

#: One thread, so that the same pictures give the same bytes.
_OPTIONS = {"g": "2", "crf": "23", "preset": "ultrafast", "threads": "1"}


class VideoFile:
    """One video that is being written.

    Args:
        path: of the file; width, height: even numbers of pixels; fps: pictures per second.

    Raises:
        OSError, av.FFmpegError: the file cannot be written; so do ``add`` and ``close``.
    """

    def __init__(self, path: Path, width: int, height: int, fps: int) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self.path = path
        self._container: Any = av.open(str(path), "w")
        self._stream: Any = self._container.add_stream("libx264", rate=fps)
        self._stream.width, self._stream.height = width, height
        self._stream.pix_fmt = PIXEL_FORMAT
        self._stream.options = dict(_OPTIONS)
        self._step = Fraction(1, fps)
        self._count = 0
        self._closed = False
        try:
            # Now, because PyAV crashes when it goes on after a header that the disk has refused.
            self._container.start_encoding()
        except (OSError, av.FFmpegError):
            path.unlink(missing_ok=True)
            raise

    def add(self, picture: npt.NDArray[np.uint8]) -> None:
        """Encodes one picture of shape (H, W, 3), RGB."""
        frame: Any = av.VideoFrame.from_ndarray(picture, format="rgb24")
        frame.pts, frame.time_base = self._count, self._step
        self._count += 1
        self._container.mux(self._stream.encode(frame))

    def close(self) -> None:
        """Writes what is left, and the index; a second call does nothing."""
        if self._closed:
            return
        self._closed = True
        try:
            if self._count:  # a video without a picture cannot be completed
                self._container.mux(self._stream.encode(None))
        finally:
            self._container.close()

    def drop(self) -> None:
        """Ends it and removes the file, whole or not."""
        with contextlib.suppress(OSError, av.FFmpegError):  # a full disk takes no index
            self.close()
        self.path.unlink(missing_ok=True)

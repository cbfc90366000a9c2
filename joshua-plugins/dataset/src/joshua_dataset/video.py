"""H.264 in MP4 files: every second picture stands alone, so that any frame is found fast."""

from __future__ import annotations

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

    def add(self, picture: npt.NDArray[np.uint8]) -> None:
        """Encodes one picture of shape (H, W, 3), RGB."""
        frame: Any = av.VideoFrame.from_ndarray(picture, format="rgb24")
        frame.pts, frame.time_base = self._count, self._step
        self._count += 1
        self._container.mux(self._stream.encode(frame))

    def close(self) -> None:
        """Writes what is left, and the index."""
        self._container.mux(self._stream.encode(None))
        self._container.close()

    def drop(self) -> None:
        """Ends it and removes the file."""
        if self._count:
            self.close()
        else:  # a video without a picture cannot be completed
            self._container.close()
        self.path.unlink(missing_ok=True)

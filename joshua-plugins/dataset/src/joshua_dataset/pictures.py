"""Storage of an episode's pictures: videos, or one file each, encoded on a separate thread."""

from __future__ import annotations

import contextlib
import errno
import queue
import shutil
import threading
import time
from abc import ABC, abstractmethod
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import numpy.typing as npt

from joshua_dataset import mp4
from joshua_dataset.files import PatientFile
from joshua_dataset.statistics import PictureStatistics, Statistics

PIXEL_FORMAT = "yuv420p"

#: Interval, in frames, of the pictures that count for the statistics.
PICTURE_STRIDE = 10

#: Longest part of a video that a killed writer can lose, s.
FRAGMENT_S = 0.5

#: Seconds of pictures that may wait for an encoder.
QUEUE_S = 2.0

# x265 reads beyond the end of an episode of two pictures when it looks ahead, and crashes.
_X265 = "log-level=error:pools=none:frame-threads=1:wpp=0:bframes=0:b-adapt=0:rc-lookahead=0"

# One thread each, so that the same pictures give the same bytes and an encoder uses at most one core;
# every second picture is a key frame (g), and both halves of an AV1 picture (tiles) are decoded at the
# same time, which makes the random reads of a training fast.
ENCODERS: dict[str, tuple[str, dict[str, str]]] = {
    "h264": ("libx264", {"g": "2", "crf": "23", "preset": "ultrafast", "threads": "1"}),
    "hevc": (
        "libx265",
        {
            "g": "2",
            "crf": "28",
            "preset": "ultrafast",
            "x265-params": _X265,
        },
    ),
    "av1": ("libsvtav1", {"g": "2", "crf": "30", "preset": "12", "svtav1-params": "lp=1:tile-columns=1"}),
}
"""Encoder and options by the codec's name in ``info.json``."""

ERRORS = (OSError, av.FFmpegError)
"""Exceptions of a disk or a codec."""

Picture = npt.NDArray[np.uint8]


class Target(ABC):
    """Output for the pictures of one feature in one episode. Raises ``ERRORS``.

    What the disk refuses waits in memory until ``close`` can write it.
    """

    path: Path

    @property
    @abstractmethod
    def disk_error(self) -> OSError | None:
        """Return why content waits; None if none does."""

    @abstractmethod
    def add(self, picture: Picture) -> None:
        """Add one picture of shape (H, W, 3), RGB."""

    @abstractmethod
    def close(self) -> None:
        """Complete the output. After an error of the disk, call it again. Idempotent."""

    def unsynced(self) -> list[Path]:
        """Return the files and folders to flush to the disk since the last call (on any thread)."""
        return [self.path]

    def drop(self) -> None:
        """Remove everything, complete or not."""
        with contextlib.suppress(*ERRORS):  # a full disk cannot hold the index
            self.close()
        if self.path.is_dir():
            shutil.rmtree(self.path, ignore_errors=True)
        else:
            with contextlib.suppress(OSError):  # a read-only disk keeps it
                self.path.unlink(missing_ok=True)


class Video(Target):
    """One MP4 video. A writer that is killed leaves all but its last ``FRAGMENT_S`` readable.

    Args:
        path: of the file; width, height: even numbers of pixels; fps: pictures per second.
        codec: of ``ENCODERS``.
    """

    def __init__(self, path: Path, width: int, height: int, fps: int, codec: str = "h264") -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self.path = path
        encoder, options = ENCODERS[codec]
        # written in fragments and turned into an ordinary MP4 file with one index when it is closed
        container_options = {
            "movflags": "hybrid_fragmented",
            "frag_duration": str(round(FRAGMENT_S * 1e6)),
            "flush_packets": "1",
        }
        self._file = PatientFile(path)
        self._container: Any = av.open(self._file, "w", format="mp4", options=container_options)
        stream: Any = self._container.add_stream(encoder, rate=fps)
        stream.width, stream.height = width, height
        stream.pix_fmt = PIXEL_FORMAT
        stream.options = dict(options)
        self._stream = stream
        self._step = Fraction(1, fps)
        self._count = 0
        self._is_muxed = False

    @property
    def disk_error(self) -> OSError | None:
        """See ``Target``."""
        return self._file.error

    def add(self, picture: Picture) -> None:
        """See ``Target``."""
        frame: Any = av.VideoFrame.from_ndarray(picture, format="rgb24")
        frame.pts, frame.time_base = self._count, self._step
        self._container.mux(self._stream.encode(frame))
        self._count += 1

    def close(self) -> None:
        """See ``Target``."""
        if self._file.closed:
            return
        if self._count and not self._is_muxed:  # FFmpeg cannot complete a video without a picture
            self._is_muxed = True
            try:
                self._container.mux(self._stream.encode(None))
            finally:
                self._container.close()
        self._file.push()
        if self._count and not mp4.fragments(self.path).is_complete:
            raise OSError(errno.EIO, "the video cannot be completed", str(self.path))
        self._file.close()

    def drop(self) -> None:
        """See ``Target``."""
        super().drop()
        self._file.close()


class PictureFiles(Target):
    """A folder with one PNG or JPEG file per picture, ``frame-000000.png``.

    Args:
        path: of the folder; suffix: ``.png`` or ``.jpg``.
    """

    def __init__(self, path: Path, suffix: str) -> None:
        path.mkdir(parents=True, exist_ok=True)
        self.path = path
        self._suffix = suffix
        self._count = self._synced = 0
        self._waiting: list[tuple[Path, bytes]] = []
        self._error: OSError | None = None

    @property
    def disk_error(self) -> OSError | None:
        """See ``Target``."""
        return self._error

    def add(self, picture: Picture) -> None:
        """See ``Target``."""
        data = encoded(picture, png=self._suffix == ".png")
        self._waiting.append((self._place(self._count), data))
        self._count += 1
        if self._error is None:
            try:
                self._push()
            except OSError as error:
                self._error = error

    def unsynced(self) -> list[Path]:
        """See ``Target``."""
        first, self._synced = self._synced, self._count
        return [*(self._place(number) for number in range(first, self._synced)), self.path]

    def close(self) -> None:
        """See ``Target``."""
        self._push()

    def _push(self) -> None:
        while self._waiting:
            path, data = self._waiting[0]
            path.write_bytes(data)
            self._waiting.pop(0)
        self._error = None

    def _place(self, number: int) -> Path:
        return self.path / f"frame-{number:06d}{self._suffix}"


def encoded(picture: Picture, *, png: bool) -> bytes:
    """Encode a picture (H, W, 3), RGB, as PNG, else as JPEG."""
    height, width, _ = picture.shape
    context: Any = av.CodecContext.create("png" if png else "mjpeg", "w")
    context.width, context.height = width, height
    context.pix_fmt, context.time_base = "rgb24" if png else "yuvj420p", Fraction(1, 1)
    context.options = {"compression_level": "1"} if png else {"qmin": "2", "qmax": "3"}
    frame: Any = av.VideoFrame.from_ndarray(picture, format="rgb24")
    frame.pts = 0
    return b"".join(bytes(packet) for packet in (*context.encode(frame), *context.encode(None)))


class Encoder:
    """Encodes the pictures of one feature on its own thread, and counts them for the statistics.

    Args:
        target: takes the pictures on that thread; name: of the thread; depth: pictures that may wait.

    Attributes:
        busy_s: time spent on encoding.
    """

    def __init__(self, target: Target, name: str, depth: int) -> None:
        self.target = target
        self.busy_s = 0.0
        self._statistics = PictureStatistics()
        self._count = 0
        self._error: Exception | None = None
        self._queue: queue.Queue[Picture | None] = queue.Queue(max(2, depth))
        self._thread = threading.Thread(target=self._run, name=f"encoder {name}", daemon=True)
        self._thread.start()

    @property
    def waiting(self) -> int:
        """Pictures in the queue."""
        return self._queue.qsize()

    @property
    def error(self) -> Exception | None:
        """Error of the disk or the codec, after which the episode cannot go on; None if it can."""
        return self._error or self.target.disk_error

    def add(self, picture: Picture) -> None:
        """Hand over a picture, which must not change afterwards; blocks while the queue is full.

        Raises:
            OSError, av.FFmpegError: the disk or the codec refused a picture before it.
        """
        if self.error is not None:
            raise self.error
        self._queue.put(picture)

    def finish(self) -> Statistics:
        """Encode the waiting pictures, close the target and return the statistics. Raises ``ERRORS``.

        After an error of the disk, call it again when the cause is removed: nothing that was handed over is
        lost.
        """
        self._end()
        if self._error is not None:
            raise self._error
        self.target.close()
        return self._statistics.result()

    def drop(self) -> None:
        """End the thread and remove the output."""
        with contextlib.suppress(queue.Empty):
            while True:
                self._queue.get_nowait()
        self._end()
        self.target.drop()

    def _end(self) -> None:
        if self._thread.is_alive():
            self._queue.put(None)
            self._thread.join()

    def _run(self) -> None:
        while (picture := self._queue.get()) is not None:
            if self._error is not None:
                continue  # the codec takes no more; the writer gets the error with its next picture
            began = time.thread_time()
            try:
                self.target.add(picture)
                if self._count % PICTURE_STRIDE == 0:
                    self._statistics.add(picture)
            except ERRORS as error:
                self._error = error
            self._count += 1
            self.busy_s += time.thread_time() - began
        with contextlib.suppress(OSError):  # content of the disk waits for ``finish``
            try:
                self.target.close()
            except av.FFmpegError as error:
                self._error = self._error or error

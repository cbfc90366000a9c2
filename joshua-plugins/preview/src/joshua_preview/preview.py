"""Shows what a sensor sees in a window, where the machine has a display.

The window is a process of its own (``preview_window``): a toolkit that fails, or a slow display over SSH,
must not touch the sensor.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import threading
from collections.abc import Callable
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from joshua_preview.window import HEAD

#: Shape (H, W, 3), RGB.
Pixels: TypeAlias = npt.NDArray[np.uint8]

REFRESH_S = 0.04
MAX_WIDTH = 960
STOP_S = 1.0


def display_problem() -> str:
    """Why there can be no window here, with the remedy; "" if there can be one."""
    if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return "display: no window, because this machine has no display; over SSH, log in with ssh -X"
    try:
        import tkinter  # noqa: F401 - Debian ships it as a package of its own
    except ImportError:
        return "display: no window, because this Python has no tkinter; on Debian, apt install python3-tk"
    return ""


class Preview:
    """A window; it shows the newest picture and never holds up the sensor.

    Args:
        title: of the window.
        caption: makes the line under the picture.
        report: called with the reason when the window cannot be opened; on a thread of this class.
    """

    def __init__(self, title: str, caption: Callable[[], str], report: Callable[[str], None]) -> None:
        self._title = title
        self._caption = caption
        self._report = report
        self._newest: Callable[[], Pixels | None] | None = None
        self._changed = threading.Event()
        self._stop = threading.Event()
        self._process: subprocess.Popen[bytes] | None = None
        self._thread = threading.Thread(target=self._feed, name="preview", daemon=True)

    def open(self) -> None:
        """Open the window."""
        command = [sys.executable, "-m", "joshua_preview.window", self._title]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE)
        self._thread.start()

    def show(self, make_pixels: Callable[[], Pixels | None]) -> None:
        """Show a picture soon, unless a newer one comes before; any thread.

        Args:
            make_pixels: makes the picture, on a thread of this class; None if that fails.
        """
        self._newest = make_pixels
        self._changed.set()

    def close(self) -> None:
        """Close the window. Idempotent."""
        self._stop.set()
        self._changed.set()
        process = self._process
        if process is None:
            return
        process.terminate()  # also ends a write that the window does not read
        self._thread.join(STOP_S)
        try:
            process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        for stream in (process.stdin, process.stderr):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()

    def _feed(self) -> None:
        """Send the newest picture to the window, at most each ``REFRESH_S``."""
        process = self._process
        assert process is not None
        assert process.stdin is not None
        assert process.stderr is not None
        try:
            while not self._stop.is_set():
                self._changed.wait()
                self._changed.clear()
                make_pixels = self._newest
                pixels = make_pixels() if make_pixels is not None else None
                if pixels is not None and not self._stop.is_set():
                    caption, image = self._caption().encode(), portable_pixmap(pixels)
                    process.stdin.write(HEAD.pack(len(caption), len(image)) + caption + image)
                    process.stdin.flush()
                self._stop.wait(REFRESH_S)
        except (OSError, ValueError):  # the window was closed, or could not be opened
            if not self._stop.is_set():
                problem = process.stderr.read().decode(errors="replace").strip()
                if problem:
                    self._report(f"display: no window: {problem.splitlines()[-1]}")


def portable_pixmap(pixels: Pixels) -> bytes:
    """A picture of shape (H, W, 3), RGB, as a PPM file, each n-th pixel of one that is too wide."""
    step = -(-pixels.shape[1] // MAX_WIDTH)
    small = pixels[::step, ::step]
    return b"P6 %d %d 255\n" % (small.shape[1], small.shape[0]) + small.tobytes()

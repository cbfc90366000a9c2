"""A window that shows what a camera sees, where the machine has a display."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable

from joshua_camera.picture import Picture, Pixels

REFRESH_S = 0.04
MAX_WIDTH = 960
JOIN_S = 1.0


def display_problem() -> str:
    """Why there can be no window here, with the remedy; "" where there can be one."""
    if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return "display: no window, for this machine has no display; over SSH, log in with ssh -X"
    try:
        import tkinter  # noqa: F401 - Debian ships it as a package of its own
    except ImportError:
        return "display: no window, for this Python has no tkinter; on Debian, apt install python3-tk"
    return ""


class Preview:
    """A window in a thread of its own; it shows the newest picture and never holds up the camera.

    Args:
        title: of the window.
        caption: makes the line under the picture.
        report: called with the reason when the window cannot be opened.
    """

    def __init__(self, title: str, caption: Callable[[], str], report: Callable[[str], None]) -> None:
        self._title = title
        self._caption = caption
        self._report = report
        self._newest: Picture | None = None
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="preview", daemon=True)

    def open(self) -> None:
        """Opens the window."""
        self._thread.start()

    def show(self, picture: Picture) -> None:
        """Shows a picture soon, unless a newer one comes before; any thread."""
        self._newest = picture

    def close(self) -> None:
        """Closes the window; a second call does nothing."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(JOIN_S)

    def _run(self) -> None:
        import tkinter

        try:
            window = tkinter.Tk()
        except tkinter.TclError as error:
            self._report(f"display: no window: {error}")
            return
        window.title(self._title)
        canvas = tkinter.Label(window, borderwidth=0)
        canvas.pack()
        line = tkinter.Label(window, anchor="w")
        line.pack(fill="x")
        shown: Picture | None = None

        def refresh() -> None:
            nonlocal shown
            if self._stop.is_set():
                window.destroy()
                return
            picture = self._newest
            if picture is not None and picture is not shown:
                shown = picture
                pixels = picture.as_rgb()
                if pixels is not None:
                    image = tkinter.PhotoImage(master=window, data=portable_pixmap(pixels), format="PPM")
                    canvas.configure(image=image)
                    canvas.image = image  # type: ignore[attr-defined] # Tk itself keeps no reference
                line.configure(text=self._caption())
            window.after(round(REFRESH_S * 1000), refresh)

        window.protocol("WM_DELETE_WINDOW", self._stop.set)
        refresh()
        window.mainloop()


def portable_pixmap(pixels: Pixels) -> bytes:
    """A picture of shape (H, W, 3), RGB, as a PPM file, each n-th pixel of one that is too wide."""
    step = -(-pixels.shape[1] // MAX_WIDTH)
    small = pixels[::step, ::step]
    return b"P6 %d %d 255\n" % (small.shape[1], small.shape[0]) + small.tobytes()

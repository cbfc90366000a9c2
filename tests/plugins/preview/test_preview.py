"""The window, on a virtual screen whose memory is read back."""

from __future__ import annotations

import importlib.util
import shutil
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from joshua_preview import preview
from joshua_preview.preview import Pixels, Preview, display_problem, portable_pixmap

ORANGE = (250, 130, 20)


def picture(height: int, width: int, colour: tuple[int, int, int]) -> Callable[[], Pixels]:
    return lambda: np.full((height, width, 3), colour, np.uint8)


def test_a_pixmap_is_thinned_to_the_screen() -> None:
    pixels = np.zeros((100, 2000, 3), np.uint8)
    assert portable_pixmap(pixels).startswith(b"P6 667 34 255\n")
    small = np.arange(12, dtype=np.uint8).reshape(2, 2, 3)
    assert portable_pixmap(small) == b"P6 2 2 255\n" + bytes(range(12))


@pytest.mark.skipif(sys.platform != "linux", reason="asks for the X display of Linux")
def test_no_display(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert "this machine has no display; over SSH, log in with ssh -X" in display_problem()


def test_no_tkinter(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DISPLAY", ":99")
    monkeypatch.setitem(sys.modules, "tkinter", None)
    assert "this Python has no tkinter; on Debian, apt install python3-tk" in display_problem()


@pytest.mark.skipif(importlib.util.find_spec("tkinter") is None, reason="needs tkinter")
def test_a_display_that_is_gone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DISPLAY", "127.0.0.1:973")
    reasons: list[str] = []
    window = Preview("camera", lambda: "", reasons.append)
    window.open()

    def refused() -> bool:
        window.show(picture(8, 8, (0, 0, 0)))
        return bool(reasons)

    wait_until(refused)
    window.close()
    assert reasons[0].startswith("display: no window: ")


class Screen:
    """A virtual screen."""

    def __init__(self, memory: Path) -> None:
        self._memory = memory

    def shows(self, colour: tuple[int, int, int]) -> int:
        """How many pixels have a colour (X window dump format, 32 bits a pixel)."""
        data = self._memory.read_bytes()
        header = struct.unpack(">25I", data[:100])
        size, width, height, colours = header[0], header[4], header[5], header[19]
        start = size + 12 * colours
        pixels = np.frombuffer(data, np.uint8, 4 * width * height, start).reshape(-1, 4)
        return int((pixels[:, 2::-1] == colour).all(axis=1).sum())


@pytest.fixture
def screen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Screen]:
    server = shutil.which("Xvfb")
    if server is None or importlib.util.find_spec("tkinter") is None:
        pytest.skip("a window needs a screen: Xvfb and tkinter (apt install xvfb python3-tk)")
    command = [server, "-displayfd", "1", "-screen", "0", "800x600x24", "-fbdir", str(tmp_path)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        assert process.stdout is not None
        monkeypatch.setenv("DISPLAY", f":{process.stdout.readline().strip()}")
        yield Screen(tmp_path / "Xvfb_screen0")
    finally:
        process.terminate()
        process.communicate()


def wait_until(condition: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + 30
    while not condition():
        assert time.monotonic() < deadline_s
        time.sleep(0.02)


def test_the_window_shows_the_newest_picture(screen: Screen) -> None:
    reasons: list[str] = []
    window = Preview("camera_top", lambda: "30.0 Hz", reasons.append)
    window.open()
    window.show(picture(240, 320, (0, 0, 0)))
    window.show(picture(240, 320, ORANGE))
    wait_until(lambda: screen.shows(ORANGE) == 240 * 320)
    window.show(picture(120, 160, ORANGE))
    wait_until(lambda: screen.shows(ORANGE) == 120 * 160)
    window.close()
    wait_until(lambda: screen.shows(ORANGE) == 0)
    window.close()
    assert not window._thread.is_alive()
    assert not reasons
    assert preview.display_problem() == ""

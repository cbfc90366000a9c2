"""A virtual screen for tests of windows."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

WIDTH, HEIGHT = 1024, 768


def available() -> bool:
    """Whether this machine can make one (Debian's package xvfb)."""
    return shutil.which("Xvfb") is not None


@contextmanager
def virtual_screen(folder: Path) -> Iterator[str]:
    """Runs a screen whose content lies in a file of ``folder``; yields what DISPLAY must say."""
    read, write = os.pipe()
    size = f"{WIDTH}x{HEIGHT}x24"
    arguments = ["Xvfb", "-displayfd", str(write), "-screen", "0", size, "-fbdir", str(folder)]
    server = subprocess.Popen(arguments, pass_fds=(write,), stderr=subprocess.DEVNULL)
    os.close(write)
    try:
        with os.fdopen(read) as pipe:
            number = pipe.readline().strip()
        yield f":{number}"
    finally:
        server.terminate()
        server.wait()


def colours(folder: Path) -> int:
    """How many different colours the screen shows; an empty one is black."""
    raw = (folder / "Xvfb_screen0").read_bytes()
    return len(np.unique(np.frombuffer(raw[-WIDTH * HEIGHT * 4 :], np.uint32)))

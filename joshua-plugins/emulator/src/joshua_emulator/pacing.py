"""Waking up on time."""

from __future__ import annotations

import contextlib
import sys
from pathlib import Path


def sharpen_timers() -> None:
    """Ask the kernel to wake this process within microseconds instead of 50 µs, where it can."""
    slack = Path("/proc/self/timerslack_ns")
    if sys.platform == "linux" and slack.exists():
        with contextlib.suppress(OSError):
            slack.write_text("1000", encoding="ascii")

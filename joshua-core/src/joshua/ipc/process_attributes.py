"""Attributes of a process that only the kernel can set; each call does nothing where there are none."""

from __future__ import annotations

import ctypes
import sys
from functools import lru_cache

# Numbers of linux/prctl.h.
PR_SET_PDEATHSIG = 1
PR_SET_NAME = 15
PR_SET_TIMERSLACK = 29
PR_SET_CHILD_SUBREAPER = 36


@lru_cache(maxsize=1)
def _libc() -> ctypes.CDLL:
    return ctypes.CDLL(None, use_errno=True)


def _prctl(option: int, value: object) -> bool:
    if sys.platform != "linux":
        return False
    return bool(_libc().prctl(option, value, 0, 0, 0) == 0)


def set_title(name: str) -> bool:
    """Names the calling thread, and the process when called on its main thread; 15 bytes are kept."""
    return _prctl(PR_SET_NAME, ctypes.c_char_p(name.encode("utf-8", "replace")[:15]))


def set_parent_death_signal(number: int) -> bool:
    """Has the kernel send a signal when the parent dies; 0 takes that back. False where it cannot."""
    return _prctl(PR_SET_PDEATHSIG, ctypes.c_ulong(number))


def set_timer_slack(nanoseconds: int) -> bool:
    """Sets how far the kernel may delay this thread's wake-ups to bundle them (default 50 µs)."""
    return _prctl(PR_SET_TIMERSLACK, ctypes.c_ulong(nanoseconds))


def set_child_subreaper(enabled: bool) -> bool:
    """Has orphaned descendants become children of this process instead of the init process."""
    return _prctl(PR_SET_CHILD_SUBREAPER, ctypes.c_ulong(int(enabled)))

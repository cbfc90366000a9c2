"""Keeps freed memory in the process, so that each image does not pay for fresh pages.

A 640 × 480 image has 225 pages; the C library gives them back to the system when an image is freed, and
the next one faults them in again, three times on its way. That is half of its latency and of its
processor time.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
from functools import lru_cache

# parameters of mallopt(3)
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3
_KEPT_B = 64 * 2**20
_LARGEST_BLOCK_B = 32 * 2**20  # the most that glibc allows


@lru_cache(maxsize=1)
def keep_freed_memory() -> bool:
    """Tells the C library to keep up to 64 MiB of freed memory.

    Returns:
        whether the C library can; only glibc does.
    """
    with contextlib.suppress(ValueError, OSError, AttributeError):
        if "glibc" in (os.confstr("CS_GNU_LIBC_VERSION") or ""):
            return _set_options()
    return False


def _set_options() -> bool:
    libc = ctypes.CDLL(None)
    set_option = libc.mallopt
    done = set_option(_M_MMAP_THRESHOLD, _LARGEST_BLOCK_B) and set_option(_M_TRIM_THRESHOLD, _KEPT_B)
    return bool(done)

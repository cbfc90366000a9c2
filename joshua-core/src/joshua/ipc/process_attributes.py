"""Attributes of a process that only the kernel can set; each call does nothing where there are none."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from functools import lru_cache

#: Signals that the supervisor answers for its children.
IGNORED_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

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


def use_realtime_priority(priority: int = 1) -> bool:
    """Gives the calling thread a real-time priority where the system's limits grant one to this user.

    Without it a busy machine delays a thread that wakes up by several milliseconds. The grant is
    ``RLIMIT_RTPRIO``, such as ``rtprio 1`` in limits.conf; root without it does not count as asked for.

    Returns:
        whether the thread has it now.
    """
    if sys.platform != "linux":
        return False
    import resource

    granted, _ = resource.getrlimit(resource.RLIMIT_RTPRIO)
    if granted != resource.RLIM_INFINITY and granted < priority:
        return False
    try:
        # Programs that the thread starts do not inherit it.
        policy = os.SCHED_RR | os.SCHED_RESET_ON_FORK
        os.sched_setscheduler(0, policy, os.sched_param(priority))
    except OSError:
        return False
    return True

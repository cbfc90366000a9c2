"""Attributes of a process that the kernel sets. Each call does nothing on a system without them."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from functools import lru_cache

#: Signals that the supervisor handles for its children.
IGNORED_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

# Numbers of linux/prctl.h.
PR_SET_PDEATHSIG = 1
PR_SET_NAME = 15
PR_SET_TIMERSLACK = 29
PR_SET_CHILD_SUBREAPER = 36

# Flags of linux/mman.h.
MCL_CURRENT, MCL_FUTURE, MCL_ONFAULT = 1, 2, 4

#: Nice value of a control loop without real-time priority, if the system grants it.
NICE = -10


@lru_cache(maxsize=1)
def _libc() -> ctypes.CDLL:
    return ctypes.CDLL(None, use_errno=True)


def _prctl(option: int, value: object) -> bool:
    if sys.platform != "linux":
        return False
    return bool(_libc().prctl(option, value, 0, 0, 0) == 0)


def set_title(name: str) -> bool:
    """Names the calling thread, or the process when called on its main thread. 15 bytes are kept."""
    return _prctl(PR_SET_NAME, ctypes.c_char_p(name.encode("utf-8", "replace")[:15]))


def set_command_line(text: str) -> None:
    """Shows a text in place of the command line of this process, cut to its length."""
    try:
        with open("/proc/self/stat", encoding="utf-8") as file:  # noqa: PTH123 (light)
            start, end = (int(word) for word in file.read().rpartition(")")[2].split()[45:47])
    except (OSError, ValueError):
        return
    if 0 < start < end:  # the kernel hides them from some processes
        ctypes.memmove(start, text.encode()[: end - start - 1].ljust(end - start, b"\0"), end - start)


def set_parent_death_signal(number: int) -> bool:
    """Makes the kernel send a signal when the parent dies, 0 for none."""
    return _prctl(PR_SET_PDEATHSIG, ctypes.c_ulong(number))


def set_timer_slack(nanoseconds: int) -> bool:
    """Sets how long the kernel may delay this thread's wake-ups to bundle them (default 50 µs)."""
    return _prctl(PR_SET_TIMERSLACK, ctypes.c_ulong(nanoseconds))


def set_child_subreaper(enabled: bool) -> bool:
    """Makes orphaned descendants children of this process instead of the init process."""
    return _prctl(PR_SET_CHILD_SUBREAPER, ctypes.c_ulong(int(enabled)))


def prefer_this_process(realtime: int = 1) -> str:
    """Raises the priority of the threads of this process as far as the system's limits grant it to this user.

    All threads, because a thread that waits for a processor may hold the interpreter lock that the control
    loop needs; but those that stand lower than the present one compute, and stay where they are.
    ``RLIMIT_RTPRIO`` grants SCHED_RR, ``RLIMIT_NICE`` a nice value below 0. Privileges of root do
    not count as a grant. Processes and threads started later inherit it. SCHED_RR shares a processor between
    equals: with SCHED_FIFO, an endless loop in a driver could starve its guardian.

    Returns:
        What was granted, such as ``SCHED_RR 1`` or ``nice -10``; "" for nothing.
    """
    if sys.platform != "linux":
        return ""
    import resource

    rtprio, nice = (resource.getrlimit(which)[0] for which in (resource.RLIMIT_RTPRIO, resource.RLIMIT_NICE))
    lowest = max(-20, NICE, -20 if nice == resource.RLIM_INFINITY else 20 - nice)
    realtime_granted = rtprio == resource.RLIM_INFINITY or rtprio >= realtime
    if not realtime_granted and lowest >= 0:
        return ""
    present = os.getpriority(os.PRIO_PROCESS, 0)
    for name in os.listdir("/proc/self/task"):  # noqa: PTH208 (names are all it needs)
        try:
            if os.getpriority(os.PRIO_PROCESS, int(name)) > present:
                continue
            if realtime_granted:
                os.sched_setscheduler(int(name), os.SCHED_RR, os.sched_param(realtime))
            else:
                os.setpriority(os.PRIO_PROCESS, int(name), lowest)
        except ProcessLookupError:  # a thread that has just ended
            continue
        except OSError:  # a container may refuse what its limits grant
            return ""
    return f"SCHED_RR {realtime}" if realtime_granted else f"nice {lowest}"


def lock_memory() -> bool:
    """Keeps this process in memory where ``RLIMIT_MEMLOCK`` is unlimited. Returns whether it is locked.

    Only pages in use are locked, because a child shares most pages with the fork server.
    """
    if sys.platform != "linux":
        return False
    import resource

    if resource.getrlimit(resource.RLIMIT_MEMLOCK)[0] != resource.RLIM_INFINITY:
        return False  # exceeding a limit later would make allocations fail
    return bool(_libc().mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) == 0)

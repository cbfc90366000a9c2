"""Thread priorities on a busy machine: the loop that plays the actions precedes the model."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

#: How much lower the priority of a model's threads is than that of the others. Hardly, if the loop gets
#: real-time priority: a thread that waits for a processor may hold the interpreter lock that the loop needs.
NICER, NICER_THAN_REAL_TIME = 10, 1

_TASKS = Path("/proc/self/task")


def stand_back(threads: Iterable[int] = ()) -> None:
    """Lower threads of this process, by default the present one; they start lower ones.

    They compute in normal scheduling, whatever scheduling the thread that started them has.
    """
    if sys.platform != "linux":
        return
    for thread in tuple(threads) or (threading.get_native_id(),):
        try:
            os.sched_setscheduler(thread, os.SCHED_OTHER, os.sched_param(0))
            nice = os.getpriority(os.PRIO_PROCESS, thread)
            os.setpriority(os.PRIO_PROCESS, thread, min(19, nice + nicer()))
        except ProcessLookupError:  # it has just ended
            continue


def nicer() -> int:
    """Return how much lower the priority of a model's threads is here."""
    import resource

    limit = resource.getrlimit(resource.RLIMIT_RTPRIO)[0]
    return NICER_THAN_REAL_TIME if limit == resource.RLIM_INFINITY or limit >= 1 else NICER


@contextmanager
def threads_stand_back() -> Iterator[None]:
    """Lower threads that are started meanwhile: the pools in which libraries compute."""
    if threading.current_thread() is not threading.main_thread():
        stand_back()  # before it starts others
        yield
        return
    before = _threads()
    try:
        yield
    finally:
        if started := _threads() - before:
            stand_back(started)


def _threads() -> set[int]:
    return {int(path.name) for path in _TASKS.iterdir()} if _TASKS.is_dir() else set()

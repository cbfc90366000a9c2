"""The threads of a model stand below the loop that plays its actions."""

from __future__ import annotations

import os
import resource
import sys
import threading

import pytest
from joshua_inference.priority import nicer, stand_back, threads_stand_back

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="threads have priorities of their own on Linux"
)


def nice(thread: int) -> int:
    return os.getpriority(os.PRIO_PROCESS, thread)


def waiting(end: threading.Event) -> threading.Thread:
    thread = threading.Thread(target=end.wait)
    thread.start()
    return thread


def test_threads_that_are_started_while_a_model_is_loaded_stand_back() -> None:
    own, end = nice(threading.get_native_id()), threading.Event()
    before = waiting(end)
    with threads_stand_back():
        pool = waiting(end)
    found = [nice(thread.native_id or 0) for thread in (before, pool)]
    end.set()
    assert found == [own, own + nicer()]
    assert nice(threading.get_native_id()) == own, "the loop itself stays where it is"


def test_a_thread_that_loads_a_model_again_stands_back_itself() -> None:
    found: list[int] = []

    def load() -> None:
        with threads_stand_back():
            end = threading.Event()
            pool = waiting(end)
            found.extend(nice(thread or 0) for thread in (threading.get_native_id(), pool.native_id))
            end.set()

    thread = threading.Thread(target=load)
    thread.start()
    thread.join()
    assert found == [nice(threading.get_native_id()) + nicer()] * 2


def test_a_thread_that_has_ended_is_left_out() -> None:
    end = threading.Event()
    thread = waiting(end)
    number = thread.native_id or 0
    end.set()
    thread.join()
    stand_back([number])


def test_threads_that_may_hold_the_interpreter_get_their_turn_where_the_loop_has_real_time_priority(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for limit, lower in ((0, 10), (1, 1), (resource.RLIM_INFINITY, 1)):
        monkeypatch.setattr(resource, "getrlimit", lambda which, limit=limit: (limit, limit))
        assert nicer() == lower

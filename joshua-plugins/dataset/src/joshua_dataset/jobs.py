"""Parallel work on many episodes; results come in order, whatever the number of workers."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from multiprocessing import get_context
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


def in_order(
    function: Callable[[Item], Result], items: Iterable[Item], workers: int | None = None
) -> Iterator[Result]:
    """Apply a function to items in several processes; yield the results in the order of the items.

    At most two items per worker are in progress, which bounds the use of memory.

    Args:
        function: at module level, which another process can import; its exception is raised here.
        workers: processes; None for one per core, 1 to work in this process.
    """
    count = workers if workers is not None else len(os.sched_getaffinity(0))
    if count <= 1:
        yield from map(function, items)
        return
    # spawned, because the libraries for videos and tables have threads that a fork would lose
    with ProcessPoolExecutor(count, mp_context=get_context("spawn")) as pool:
        waiting: list[Future[Result]] = []
        try:
            for item in items:
                waiting.append(pool.submit(function, item))
                if len(waiting) >= 2 * count:
                    yield waiting.pop(0).result()
            while waiting:
                yield waiting.pop(0).result()
        finally:
            for future in waiting:
                future.cancel()

"""The executor of this machine: processes, or this process alone."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures import TimeoutError as NotYet
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from typing import Any

from joshua_jobs.executor import Crew, Executor, Item, JobError, Result, Stopped, never

#: How often a waiting executor asks whether it is stopped.
POLL_S = 0.2


def in_order(
    function: Callable[[Item], Result], items: Iterable[Item], workers: Executor | int | None = None
) -> Iterator[Result]:
    """Apply a function to items; yield the results in order, see ``Executor.in_order``.

    Args:
        workers: an executor, which stays open; a number of processes; None for one process per core.
    """
    if isinstance(workers, Executor):
        yield from workers.in_order(function, items)
        return
    with Processes(workers) as executor:
        yield from executor.in_order(function, items)


class Processes(Executor):
    """Processes of this machine.

    Args:
        count: None for one per core; 1 works in this process.
    """

    def __init__(self, count: int | None = None) -> None:
        self._count = max(1, count if count is not None else len(os.sched_getaffinity(0)))
        self._pool: ProcessPoolExecutor | None = None

    @property
    def workers(self) -> int:
        """See ``Executor``."""
        return self._count

    def in_order(
        self,
        function: Callable[[Item], Result],
        items: Iterable[Item],
        stopping: Callable[[], bool] = never,
    ) -> Iterator[Result]:
        """See ``Executor``."""
        if self._count == 1:
            for item in items:
                if stopping():
                    raise Stopped
                yield function(item)
            return
        if self._pool is None:
            # spawned, because the libraries for videos and tables have threads that a fork would lose
            self._pool = ProcessPoolExecutor(self._count, mp_context=get_context("spawn"))
        waiting: deque[Future[Result]] = deque()
        try:
            for item in items:
                waiting.append(self._pool.submit(function, item))
                if len(waiting) >= 2 * self._count:
                    yield _result(waiting.popleft(), stopping)
            while waiting:
                yield _result(waiting.popleft(), stopping)
        except BrokenProcessPool as error:
            self.close()  # a later call gets other processes
            raise JobError(
                f"one of {self._count} worker processes was killed, probably for lack of memory: "
                "lower --workers"
            ) from error
        finally:
            for future in waiting:
                future.cancel()

    def crew(self, make: Callable[..., Any], arguments: Sequence[tuple[Any, ...]]) -> Crew:
        """See ``Executor``. The objects live in this process and are called in turn."""
        return _Here([make(*some) for some in arguments])

    def close(self) -> None:
        """See ``Executor``."""
        pool, self._pool = self._pool, None
        if pool is not None:
            pool.shutdown(cancel_futures=True)


def _result(future: Future[Result], stopping: Callable[[], bool]) -> Result:
    while True:
        if stopping():
            raise Stopped
        try:
            return future.result(None if stopping is never else POLL_S)
        except NotYet:
            if future.done():  # the function itself raised it
                raise


class _Here(Crew):
    """Objects in this process."""

    def __init__(self, members: list[Any]) -> None:
        self._members = members

    def each(
        self,
        method: str,
        arguments: Sequence[tuple[Any, ...]],
        stopping: Callable[[], bool] = never,
    ) -> list[Any]:
        """See ``Crew``."""
        found = []
        for member, some in zip(self._members, arguments, strict=True):
            if stopping():
                raise Stopped
            found.append(getattr(member, method)(*some))
        return found

    def close(self) -> None:
        """See ``Crew``."""
        self._members = []

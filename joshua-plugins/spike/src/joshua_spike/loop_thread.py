"""A thread with an event loop, for a driver with a blocking interface."""

from __future__ import annotations

import asyncio
import concurrent.futures
import threading
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

from joshua.api import Cancelled
from joshua.api.patience import AwakeClock

T = TypeVar("T")

LOOK_S = 0.1  # polling period for cancellation and of the clock


class LoopThread:
    """Runs coroutines for callers in other threads, between ``start`` and ``close``."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Start the thread."""
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._run, args=(self._loop,), name=self._name, daemon=True)
        self._thread.start()

    def run(
        self,
        coroutine: Coroutine[Any, Any, T],
        timeout_s: float,
        stopping: Callable[[], bool] = lambda: False,
    ) -> T:
        """Wait for a coroutine; raise what it raises, TimeoutError when it takes longer.

        Args:
            timeout_s: of time in which this process runs; a machine that stands still does not use it up.
            stopping: polled; Cancelled is raised when it returns true.
        """
        if self._loop is None:
            coroutine.close()
            raise RuntimeError("the loop thread is not running")
        future = asyncio.run_coroutine_threadsafe(coroutine, self._loop)
        clock = AwakeClock()
        while True:
            left_s = timeout_s - clock.now_s()
            try:
                return future.result(max(0.0, min(left_s, LOOK_S)))
            except concurrent.futures.TimeoutError as error:
                if future.done():
                    raise
                if left_s > 0 and not stopping():
                    continue
                future.cancel()
                if left_s > 0:
                    raise Cancelled("asked to stop") from error
                raise TimeoutError(f"no answer within {timeout_s:g} s") from error

    def call(self, function: Callable[..., object], *arguments: Any) -> None:
        """Schedule a function on the loop; no effect after the thread has ended."""
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(function, *arguments)

    def close(self) -> None:
        """Cancel all tasks on the loop, then end the thread. Idempotent."""
        loop, thread = self._loop, self._thread
        self._loop = self._thread = None
        if loop is None or thread is None:
            return
        loop.call_soon_threadsafe(loop.stop)
        thread.join()

    @staticmethod
    def _run(loop: asyncio.AbstractEventLoop) -> None:
        asyncio.set_event_loop(loop)
        try:
            loop.run_forever()
            left = asyncio.all_tasks(loop)
            for task in left:
                task.cancel()
            loop.run_until_complete(asyncio.gather(*left, return_exceptions=True))
            loop.run_until_complete(loop.shutdown_asyncgens())
        finally:
            asyncio.set_event_loop(None)
            loop.close()

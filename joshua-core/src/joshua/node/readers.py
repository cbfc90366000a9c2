"""Reader threads of a node: blocking work beside the timers, watched for signs of life."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from joshua.ipc.messages import ThreadAge


class ReaderThread:
    """One thread that a behaviour started; asking ``context.stopping`` is its sign of life.

    Args:
        target: what it runs.
        name: for logs and reports.
        limit_s: silence after which the supervisor takes it for hung.
        prepare: called on the thread before ``target``.
        on_error: called with what ``target`` raised.
    """

    def __init__(
        self,
        target: Callable[[], None],
        name: str,
        limit_s: float,
        prepare: Callable[[], None],
        on_error: Callable[[BaseException], None],
    ) -> None:
        self.name = name
        self.limit_s = limit_s
        self._target = target
        self._prepare = prepare
        self._on_error = on_error
        self._seen_ns = time.monotonic_ns()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    @property
    def identifier(self) -> int | None:
        """Identifier of the thread as ``threading.get_ident`` returns it."""
        return self._thread.ident

    @property
    def alive(self) -> bool:
        """Whether it still runs."""
        return self._thread.is_alive()

    def start(self) -> None:
        """Starts the thread."""
        self._seen_ns = time.monotonic_ns()
        self._thread.start()

    def touch(self) -> None:
        """Counts a sign of life."""
        self._seen_ns = time.monotonic_ns()

    def age(self, now_ns: int) -> ThreadAge:
        """Time since the last sign of life."""
        return ThreadAge(name=self.name, age_s=(now_ns - self._seen_ns) / 1e9, limit_s=self.limit_s)

    def join(self, timeout_s: float) -> bool:
        """Waits for the end; returns whether it came."""
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _run(self) -> None:
        self._prepare()
        try:
            self._target()
        except Exception as error:  # noqa: BLE001 (whatever a reader raises fails its node)
            self._on_error(error)


class ReaderThreads:
    """The reader threads of one node."""

    def __init__(self) -> None:
        self._threads: list[ReaderThread] = []
        self._by_identifier: dict[int | None, ReaderThread] = {}
        self._lock = threading.Lock()

    def start(self, thread: ReaderThread) -> None:
        """Starts a thread and watches it."""
        with self._lock:
            self._threads = [known for known in self._threads if known.alive] + [thread]
            thread.start()
            self._by_identifier[thread.identifier] = thread

    def touch_current(self) -> None:
        """Counts a sign of life if the calling thread is one of these."""
        thread = self._by_identifier.get(threading.get_ident())
        if thread is not None:
            thread.touch()

    def ages(self) -> tuple[ThreadAge, ...]:
        """The age of each thread that runs."""
        now_ns = time.monotonic_ns()
        return tuple(thread.age(now_ns) for thread in self._threads if thread.alive)

    def join(self, timeout_s: float) -> list[str]:
        """Waits for all of them together; returns the names of those that still run."""
        deadline_s = time.monotonic() + timeout_s
        return [
            thread.name
            for thread in self._threads
            if not thread.join(max(0.0, deadline_s - time.monotonic()))
        ]

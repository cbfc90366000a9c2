"""The interface of the runtime for a behaviour: topics, timers, threads, reports to the supervisor."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable
from dataclasses import asdict

from joshua.guardian.latch import EstopReport, Latch
from joshua.ipc.messages import (
    Estopped,
    Message,
    Progressed,
    Said,
    ThreadAge,
)
from joshua.node import ros_time
from joshua.node.cadence import TrafficFigures
from joshua.node.endpoints import Endpoints, MessageCallback, MessagePublisher, WriterMessageCallback
from joshua.node.timers import Timer, TimerQueue
from joshua.plan import NodeKind, NodeSpec, TopicSpec
from joshua.plan.foreign_text import printable
from joshua.plan.progress import Progress

#: Time without a poll after which a reader thread counts as hung, by kind of node. Inference may take long.
READER_HANG_S: dict[NodeKind, float] = {NodeKind.MODEL: 60.0}
READER_HANG_DEFAULT_S = 5.0

#: Time between two progress reports.
PROGRESS_PERIOD_S = 0.2


class NodeFailedError(Exception):
    """A behaviour declared its node as failed."""


class ReaderThread(threading.Thread):
    """A thread that a behaviour started. Polling ``context.stopping`` is its heartbeat."""

    def __init__(self, run: Callable[[], None], name: str, limit_s: float) -> None:
        super().__init__(target=run, name=name, daemon=True)
        self.limit_s = limit_s
        self.seen_ns = time.monotonic_ns()


class NodeContext:
    """The interface of the runtime for a behaviour, for the node's own thread unless stated otherwise.

    Args:
        spec: the node's part of the plan; ``spec.facts.restarted`` is true after a failure.
        log: logger that sends records to the supervisor with the node's name.
        send: takes messages for the supervisor.
        prepare_thread: called on each new reader thread.
        wake: wakes the node's loop.

    Attributes:
        held_estop: an e-stop that could not be stored as a file, None if there is none.
        estop_came: an e-stop was latched or released since the loop last looked.
    """

    def __init__(
        self,
        spec: NodeSpec,
        log: logging.Logger,
        send: Callable[[Message], None],
        prepare_thread: Callable[[], None],
        wake: Callable[[], None],
    ) -> None:
        self.spec = spec
        self.log = log
        self.timer_queue = TimerQueue()
        self.endpoints: Endpoints | None = None
        self.warnings: list[str] = []
        self.failure: BaseException | None = None
        self.fault_reason = ""
        self.held_estop: Latch | None = None
        self.estop_came = False
        self._stop_requested = False
        self._send = send
        self._prepare_thread = prepare_thread
        self._wake = wake
        self._lock = threading.Lock()
        self._readers: list[ReaderThread] = []
        self._shown = ""
        self._progress: dict[str, tuple[float, float, float, float]] = {}

    def publisher(self, topic: TopicSpec) -> MessagePublisher:
        """Declares a publisher of the node block, or one of the node such as ``~/applied_command``."""
        return self._declared().publisher(topic)

    def subscribe(self, topic: TopicSpec, callback: MessageCallback) -> TrafficFigures:
        """Calls ``callback(message, received_ns)`` on a transport thread for each message.

        ``received_ns`` is on the node's clock for stamps.
        An exception in the callback fails the node. A payload that cannot be decoded is logged and skipped.
        Returns the figures of the topic.
        """
        return self._declared().subscribe(topic, callback)

    def subscribe_with_writer(self, topic: TopicSpec, callback: WriterMessageCallback) -> TrafficFigures:
        """Calls ``callback(message, received_ns, writer)``; otherwise like ``subscribe``.

        ``writer`` is the publisher. The name of its node may be unknown at its first messages.
        """
        return self._declared().subscribe_with_writer(topic, callback)

    def create_timer(self, period_s: float, callback: Callable[[], None], *, name: str = "") -> Timer:
        """Calls back on the node's thread at a fixed rate on the monotonic clock, without drift.

        The first tick is one period after ``activate`` has returned. Ticks missed during a long callback are
        skipped and counted. Raises ValueError if the period is not a positive number.
        """
        timer = Timer(period_s, callback, name or f"timer {len(self.timer_queue.timers) + 1}")
        self.timer_queue.add(timer)
        return timer

    def spawn_thread(
        self, target: Callable[[], None], *, name: str, hang_after_s: float | None = None
    ) -> None:
        """Runs a blocking reader beside the timers. Its exception fails the node. It is joined at the end.

        Args:
            target: polls ``stopping`` and returns soon after it becomes true. A reader that does not poll it
                for ``hang_after_s`` counts as hung.
            name: for logs and reports.
            hang_after_s: the limit; None takes the default of the node's kind.
        """

        def run() -> None:
            self._prepare_thread()
            try:
                target()
            except Exception as error:  # noqa: BLE001 (whatever a reader raises fails its node)
                self.fail_with(error)

        limit_s = hang_after_s or READER_HANG_S.get(self.spec.kind, READER_HANG_DEFAULT_S)
        with self._lock:
            thread = ReaderThread(run, name, limit_s)
            thread.start()
            self._readers = [*(known for known in self._readers if known.is_alive()), thread]

    @property
    def stopping(self) -> bool:
        """Whether the node has been asked to stop. Readers poll it, which is their heartbeat."""
        thread = threading.current_thread()
        if isinstance(thread, ReaderThread):
            thread.seen_ns = time.monotonic_ns()
        return self._stop_requested

    @property
    def stop_requested(self) -> bool:
        """The same, without the heartbeat."""
        return self._stop_requested

    def now_ns(self) -> int:
        """The node's clock for stamps, ns since the epoch."""
        return ros_time.now_ns()

    def fail(self, reason: str) -> None:
        """Ends the node as failed with a reason that names the device and the remedy. Any thread."""
        self.fail_with(NodeFailedError(reason))

    def fail_with(self, error: BaseException) -> None:
        """Ends the node as failed with an exception. The first one counts, later ones are logged."""
        with self._lock:
            first = self.failure is None
            if first:
                self.failure = error
        if not first:
            self.log.error("another failure: %s: %s", type(error).__name__, error)
        self.request_stop()

    def request_stop(self) -> None:
        """Asks the node to stop. Any thread, any number of times."""
        self._stop_requested = True
        self._wake()

    def warn(self, text: str) -> None:
        """Adds a warning to the node's row of the start-up table. Any thread."""
        self.warnings.append(printable(text))
        self._send(Said(kind="warning", node=self.spec.full_name, text=printable(text)))

    def waiting_for(self, text: str) -> None:
        """Reports what the node waits for, for the message of a start that takes too long; "" clears it."""
        self._send(Said(kind="waiting", node=self.spec.full_name, text=printable(text)))

    def fault(self, reason: str) -> None:
        """Reports that the node runs, but its device is stopped until it is resumed; "" clears it."""
        if reason:
            self.log.error("%s", reason)
        self.fault_reason = reason
        self._send(Said(kind="fault", node=self.spec.full_name, text=printable(reason)))

    def take_estop(self, latch: Latch | None, *, stored: bool) -> None:
        """Takes an e-stop, or its release (None), from the supervisor. Any thread.

        Args:
            stored: the latch is a file, which the node reads itself.
        """
        self.held_estop = None if stored else latch
        self.estop_came = True
        self._wake()

    def estopped(self, report: EstopReport) -> None:
        """Reports the effect of an e-stop on the device."""
        self._send(Estopped(node=self.spec.full_name, report=asdict(report)))

    def show(self, text: str) -> None:
        """Sets a short text in the node's part of the live status line; "" removes it. Any thread."""
        if text != self._shown:
            self._shown = text
            self._send(Said(kind="shown", node=self.spec.full_name, text=printable(text, 120)))

    def progress(
        self,
        name: str,
        current: float,
        total: float | None = None,
        *,
        unit: str = "",
        rate: float | None = None,
        remaining_s: float | None = None,
    ) -> None:
        """Reports the progress of finite work, at any rate. Any thread.

        Args:
            name: of the work, such as ``episodes``.
            current: finished work in ``unit``; total: all of it, None if unknown.
            rate: units per second; remaining_s: time to the end. None computes them from earlier reports.
        """
        now_s = time.monotonic()
        began_s, first, sent_s, sent = self._progress.get(name, (now_s, current, -math.inf, math.nan))
        if current < first:  # the work restarts
            began_s, first = now_s, current
        if current == sent or (current != total and now_s - sent_s < PROGRESS_PERIOD_S):
            return
        self._progress[name] = (began_s, first, now_s, current)
        if rate is None and current > first and now_s > began_s:
            rate = (current - first) / (now_s - began_s)
        if remaining_s is None and total is not None and rate:
            remaining_s = max(0.0, (total - current) / rate)
        node = self.spec.full_name
        said = Progress(node, printable(name, 60), current, total, printable(unit, 20), rate, remaining_s)
        self._send(Progressed(node=node, progress=said))

    def end_run(self, reason: str) -> None:
        """Requests a clean end of the whole run, because the node's work is done. Any thread."""
        self._send(Said(kind="stop-run", node=self.spec.full_name, text=printable(reason)))

    def reader_ages(self) -> tuple[ThreadAge, ...]:
        """The time since the last heartbeat of each running reader thread."""
        now_ns = time.monotonic_ns()
        return tuple(
            ThreadAge(name=thread.name, age_s=(now_ns - thread.seen_ns) / 1e9, limit_s=thread.limit_s)
            for thread in self._readers
            if thread.is_alive()
        )

    def join_readers(self, timeout_s: float) -> list[str]:
        """Waits for all reader threads together. Returns the names of those still running."""
        deadline_s = time.monotonic() + timeout_s
        for thread in self._readers:
            thread.join(max(0.0, deadline_s - time.monotonic()))
        return [thread.name for thread in self._readers if thread.is_alive()]

    def _declared(self) -> Endpoints:
        if self.endpoints is None:
            raise RuntimeError(f"{self.spec.full_name} has left the graph; it cannot declare topics now")
        return self.endpoints

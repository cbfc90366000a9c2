"""What the runtime offers to a behaviour: ``NodeContext`` made real."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable

from joshua.ipc.messages import (
    Message,
    Progressed,
    Said,
    printable,
)
from joshua.node import ros_time
from joshua.node.endpoints import CountingPublisher, Endpoints, MessageCallback, NamedMessageCallback
from joshua.node.readers import ReaderThread, ReaderThreads
from joshua.node.timers import Timer, TimerQueue
from joshua.plan import NodeKind, NodeSpec, TopicSpec
from joshua.plan.events import Progress

#: Silence of a reader thread that counts as a hang, by kind of node. A model may think for long.
READER_HANG_S: dict[NodeKind, float] = {NodeKind.MODEL: 60.0}
READER_HANG_DEFAULT_S = 5.0

#: Distance of two reports of progress.
PROGRESS_PERIOD_S = 0.2


class NodeFailedError(Exception):
    """A behaviour declared its node as failed."""


class RuntimeContext:
    """The context of one node.

    Args:
        spec: the node's part of the plan.
        log: the node's logger.
        send: takes messages for the supervisor.
        prepare_thread: called on each new reader thread.
        wake: wakes the node's loop.
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
        self.timers = TimerQueue()
        self.readers = ReaderThreads()
        self.endpoints: Endpoints | None = None
        self.warnings: list[str] = []
        self.failure: BaseException | None = None
        self._send = send
        self._prepare_thread = prepare_thread
        self._wake = wake
        self._lock = threading.Lock()
        self._stopping = False
        self._shown = ""
        self._progress: dict[str, tuple[float, float, float, float]] = {}

    def publisher(self, topic: TopicSpec) -> CountingPublisher:
        """Declares a publisher."""
        return self._declared().publisher(topic)

    def subscribe(self, topic: TopicSpec, callback: MessageCallback) -> None:
        """Declares a subscription."""
        self._declared().subscribe(topic, callback)

    def subscribe_named(self, topic: TopicSpec, callback: NamedMessageCallback) -> None:
        """Declares a subscription whose callback learns which node published each message."""
        self._declared().subscribe_named(topic, callback)

    def create_timer(self, period_s: float, callback: Callable[[], None], *, name: str = "") -> None:
        """Adds a timer; raises ValueError if the period is not a positive number."""
        self.timers.add(Timer(period_s, callback, name or f"timer {len(self.timers.timers) + 1}"))

    def spawn_thread(
        self, target: Callable[[], None], *, name: str, hang_after_s: float | None = None
    ) -> None:
        """Starts a reader thread."""
        limit_s = hang_after_s or READER_HANG_S.get(self.spec.kind, READER_HANG_DEFAULT_S)
        self.readers.start(ReaderThread(target, name, limit_s, self._prepare_thread, self.fail_with))

    @property
    def stopping(self) -> bool:
        """Whether the node has been asked to stop; asking counts as a sign of life of a reader."""
        self.readers.touch_current()
        return self._stopping

    @property
    def stop_requested(self) -> bool:
        """The same, without the sign of life."""
        return self._stopping

    def now_ns(self) -> int:
        """Nanoseconds since the epoch."""
        return ros_time.now_ns()

    def fail(self, reason: str) -> None:
        """Ends the node as failed."""
        self.fail_with(NodeFailedError(reason))

    def fail_with(self, error: BaseException) -> None:
        """Ends the node as failed with an exception; the first one counts, later ones are logged."""
        with self._lock:
            first = self.failure is None
            if first:
                self.failure = error
        if not first:
            self.log.error("a further failure: %s: %s", type(error).__name__, error)
        self.request_stop()

    def request_stop(self) -> None:
        """Asks the node to stop; any thread, any number of times."""
        self._stopping = True
        self._wake()

    def warn(self, text: str) -> None:
        """Adds a warning to the start-up table."""
        self.warnings.append(printable(text))
        self._send(Said(kind="warning", node=self.spec.full_name, text=printable(text)))

    def waiting_for(self, text: str) -> None:
        """Says what the node waits for."""
        self._send(Said(kind="waiting", node=self.spec.full_name, text=printable(text)))

    def fault(self, reason: str) -> None:
        """Says that the device does nothing until it is resumed; "" ends that."""
        if reason:
            self.log.error("%s", reason)
        self._send(Said(kind="fault", node=self.spec.full_name, text=printable(reason)))

    def show(self, text: str) -> None:
        """Puts a text into the status line."""
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
        """Says how far work is; the end of it always, what lies between a few times a second."""
        now_s = time.monotonic()
        began_s, first, sent_s, sent = self._progress.get(name, (now_s, current, -math.inf, math.nan))
        if current < first:  # it begins anew
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
        """Asks for the end of the run."""
        self._send(Said(kind="stop-run", node=self.spec.full_name, text=printable(reason)))

    def _declared(self) -> Endpoints:
        if self.endpoints is None:
            raise RuntimeError(f"{self.spec.full_name} has left the graph, it cannot declare topics now")
        return self.endpoints

"""A node context that records calls, for tests of behaviours without process and transport."""

from __future__ import annotations

# ruff: noqa: D102 (joshua.node.context documents these methods)
import logging
import threading
import time
from collections.abc import Callable
from typing import Any

from joshua.guardian.latch import EstopReport, Latch
from joshua.node.cadence import TrafficFigures
from joshua.node.context import NodeContext
from joshua.node.endpoints import MessagePublisher
from joshua.node.timers import Timer
from joshua.node.writers import Writer
from joshua.plan import NodeSpec, TopicSpec
from joshua.plan.progress import Progress


class RecordingPublisher(MessagePublisher):
    """Records published messages in ``messages``."""

    def __init__(self, topic: TopicSpec) -> None:
        self.topic = topic
        self.figures = TrafficFigures(topic, is_publisher=True)
        self.messages: list[Any] = []

    def publish(self, message: Any) -> None:
        self.messages.append(message)
        self.figures.add()


class RecordingContext(NodeContext):
    """The context of a behaviour in a test, in place of the runtime's.

    The test runs timers (``tick``), delivers messages (``receive``), and reads what the behaviour reported:
    ``failures``, ``warnings``, ``faults``, ``estops``, ``ends``, ``shown``, ``waits``, ``progresses``.
    Threads are real. ``stop`` joins them and raises their exception, if any.

    Args:
        spec: the node's part of the plan.
    """

    def __init__(self, spec: NodeSpec) -> None:
        self.spec = spec
        self.log = logging.getLogger(f"joshua.testing.{spec.name}")
        self.publishers: dict[str, RecordingPublisher] = {}
        self.subscriptions: dict[str, Callable[[Any, int], None]] = {}
        self.writer_subscriptions: dict[str, Callable[[Any, int, Writer], None]] = {}
        self._received: dict[str, TrafficFigures] = {}
        self.timers: dict[str, tuple[float, Callable[[], None]]] = {}
        self.warnings: list[str] = []
        self.failures: list[str] = []
        self.faults: list[str] = []
        self.fault_reason = ""
        self.held_estop: Latch | None = None
        self.estop_came = False
        self.estops: list[EstopReport] = []
        self.shown = ""
        self.progresses: dict[str, Progress] = {}
        self.waits = ""
        self.ends: list[str] = []
        self._threads: list[threading.Thread] = []
        self._errors: list[BaseException] = []
        self._stop = threading.Event()

    def publisher(self, topic: TopicSpec) -> RecordingPublisher:
        return self.publishers.setdefault(topic.name, RecordingPublisher(topic))

    def subscribe(self, topic: TopicSpec, callback: Callable[[Any, int], None]) -> TrafficFigures:
        self.subscriptions[topic.name] = callback
        return self._received.setdefault(topic.name, TrafficFigures(topic, is_publisher=False))

    def subscribe_with_writer(
        self, topic: TopicSpec, callback: Callable[[Any, int, Writer], None]
    ) -> TrafficFigures:
        self.writer_subscriptions[topic.name] = callback
        return self._received.setdefault(topic.name, TrafficFigures(topic, is_publisher=False))

    def create_timer(self, period_s: float, callback: Callable[[], None], *, name: str = "") -> Timer:
        self.timers[name] = (period_s, callback)
        return Timer(period_s, callback, name)

    def spawn_thread(
        self, target: Callable[[], None], *, name: str, hang_after_s: float | None = None
    ) -> None:
        del hang_after_s  # heartbeats are not checked here

        def run() -> None:
            try:
                target()
            except BaseException as error:  # noqa: BLE001 (raised again by stop)
                self._errors.append(error)

        thread = threading.Thread(target=run, name=name, daemon=True)
        self._threads.append(thread)
        thread.start()

    @property
    def stopping(self) -> bool:
        return self._stop.is_set()

    def now_ns(self) -> int:
        return time.time_ns()

    def fail(self, reason: str) -> None:
        self.failures.append(reason)

    def warn(self, text: str) -> None:
        self.warnings.append(text)

    def waiting_for(self, text: str) -> None:
        self.waits = text

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
        node = self.spec.full_name
        self.progresses[name] = Progress(node, name, current, total, unit, rate, remaining_s)

    def end_run(self, reason: str) -> None:
        self.ends.append(reason)

    def fault(self, reason: str) -> None:
        self.fault_reason = reason
        self.faults.append(reason)

    def take_estop(self, latch: Latch | None, *, stored: bool) -> None:
        self.held_estop = None if stored else latch

    def estopped(self, report: EstopReport) -> None:
        self.estops.append(report)

    def show(self, text: str) -> None:
        self.shown = text

    def tick(self, name: str, times: int = 1) -> None:
        """Run a timer a number of times, without waiting."""
        for _ in range(times):
            self.timers[name][1]()

    def receive(self, topic: str, message: Any, publisher: str = "") -> None:
        """Deliver a message to a subscription; ``publisher`` is the full name of a node."""
        self._received[topic].add()
        if topic in self.writer_subscriptions:
            self.writer_subscriptions[topic](message, self.now_ns(), Writer.of_node(publisher))
        else:
            self.subscriptions[topic](message, self.now_ns())

    def stop(self, timeout_s: float = 30.0) -> None:
        """Stop the threads and wait for them.

        Raises:
            RuntimeError: a thread did not stop in time.
            BaseException: what a thread raised.
        """
        self._stop.set()
        for thread in self._threads:
            thread.join(timeout_s)
            if thread.is_alive():
                raise RuntimeError(f"the thread {thread.name} did not stop within {timeout_s:g} s")
        if self._errors:
            raise self._errors[0]

"""Publishers and subscriptions of a node, with counters."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterable
from typing import Any

from joshua.guardian.silence import AwakeClock, witness
from joshua.ipc.messages import FirstMessage, Topics
from joshua.messages import MessageError, decode, encode, preload
from joshua.node import ros_time
from joshua.node.cadence import RateLimit, TrafficFigures
from joshua.node.writers import PublisherNames, Writer
from joshua.plan import NodeSpec, TopicReport, TopicSpec
from joshua.transport import NodeHandle, Publisher, Sample, Subscription

MessageCallback = Callable[[Any, int], None]
WriterMessageCallback = Callable[[Any, int, Writer], None]

#: Malformed messages are logged at the first, then at each power of ten.
_LOGGED_COUNTS = frozenset(10**power for power in range(12))


class MessagePublisher:
    """Publishes and counts ROS 2 messages (classes of ``joshua.messages``) on one topic.

    Attributes:
        topic: its topic; figures: number and rate of its messages.
    """

    def __init__(self, publisher: Publisher, topic: TopicSpec, witness: AwakeClock | None = None) -> None:
        self.topic = topic
        self.figures = TrafficFigures(topic, is_publisher=True, witness=witness)
        self._publisher = publisher
        self._lock = threading.Lock()

    def publish(self, message: Any) -> None:
        """Serialises and sends one message. Raises MessageError if it does not match its type."""
        self._publisher.publish(encode(message))
        with self._lock:
            self.figures.add()


class Outputs:
    """The publishers of a node block, each limited to its rate.

    Args:
        publishers: one per topic of the block.
        source_hz: rate of the source; None if the device sets it.
    """

    def __init__(self, publishers: Iterable[MessagePublisher], source_hz: float | None = None) -> None:
        self._outputs = [
            (it, RateLimit(it.topic.rate_hz) if source_hz is None or it.topic.rate_hz < source_hz else None)
            for it in publishers
        ]

    def publish(self, stamp_ns: int, make: Callable[[str], Any | None]) -> None:
        """Publishes the result of ``make`` for a type, unless that is None, on each topic that is due."""
        for publisher, limit in self._outputs:
            if limit is None or limit.passes(stamp_ns):
                message = make(publisher.topic.type_name)
                if message is not None:
                    publisher.publish(message)

    def checks(self) -> list[tuple[str, bool, str]]:
        """The rows of MODE_TEST about their rates."""
        return [publisher.figures.check() for publisher, _ in self._outputs]


class CountingSubscription:
    """Deserialises messages, counts them and passes them to a behaviour.

    Args:
        topic: subscribed topic.
        hand_over: called with each message and the sample that carried it.
        on_first: called with the monotonic time of the first message.
        on_error: called with an exception of ``hand_over``.
        log: for malformed messages, which come from outside and do not fail the node.
        witness: knows when this process was stalled.
    """

    def __init__(
        self,
        topic: TopicSpec,
        hand_over: Callable[[Any, Sample], None],
        on_first: Callable[[TopicSpec, int], None],
        on_error: Callable[[BaseException], None],
        log: logging.Logger,
        witness: AwakeClock | None = None,
    ) -> None:
        self.topic = topic
        self.figures = TrafficFigures(topic, is_publisher=False, witness=witness)
        self._hand_over = hand_over
        self._on_first = on_first
        self._on_error = on_error
        self._log = log
        self._malformed = 0

    def receive(self, sample: Sample) -> None:
        """Receives one message from the transport. Never raises."""
        now_ns = time.monotonic_ns()
        try:
            message = decode(self.topic.type_name, sample.cdr)
        except MessageError as error:
            self._malformed += 1
            if self._malformed in _LOGGED_COUNTS:
                self._log.warning(
                    "%s: message %d cannot be decoded and is ignored: %s",
                    self.topic.name,
                    self._malformed,
                    error,
                )
            return
        first = self.figures.count == 0
        self.figures.add(now_ns)
        if sample.source_stamp_ns:
            self.figures.transits_ns.append(sample.received_ns - sample.source_stamp_ns)
        if first:
            self._on_first(self.topic, now_ns)
        try:
            self._hand_over(message, sample)
        except Exception as error:  # noqa: BLE001 (whatever a behaviour raises fails its node)
            self._on_error(error)


class Endpoints:
    """All endpoints of one node.

    Args:
        handle: the node in the graph.
        spec: the node's part of the plan; MODE_TEST evaluates rates, so its figures exclude system stalls.
        send: takes messages for the supervisor.
        on_error: receives an exception of a subscription's callback.
        log: the node's logger.
    """

    def __init__(
        self,
        handle: NodeHandle,
        spec: NodeSpec,
        send: Callable[[FirstMessage], None],
        on_error: Callable[[BaseException], None],
        log: logging.Logger,
    ) -> None:
        self._handle = handle
        self._full_name = spec.full_name
        self._witness = witness() if spec.facts.testing else None
        self._send = send
        self._on_error = on_error
        self._log = log
        self._publishers: list[MessagePublisher] = []
        self._subscriptions: list[CountingSubscription] = []
        self._open: list[Subscription] = []

    def publisher(self, topic: TopicSpec) -> MessagePublisher:
        """Declares a publisher. A name that begins with ``~/`` is relative to the node's name."""
        topic = self._resolve(topic)
        raw = self._handle.create_publisher(
            topic.name, topic.type_name, topic.qos, on_event=self._reporter(topic)
        )
        preload((topic.type_name,))  # not at the first message, which is sent inside a loop
        publisher = MessagePublisher(raw, topic, self._witness)
        self._publishers.append(publisher)
        return publisher

    def subscribe(self, topic: TopicSpec, callback: MessageCallback) -> TrafficFigures:
        """Declares a subscription; names as for publishers."""

        def hand_over(message: Any, sample: Sample) -> None:
            callback(message, ros_time.received_ns(sample.received_ns))

        return self._subscribe(topic, hand_over)

    def subscribe_with_writer(self, topic: TopicSpec, callback: WriterMessageCallback) -> TrafficFigures:
        """Declares a subscription whose callback receives the publisher of each message."""
        names = PublisherNames(self._handle.publisher_node)

        def hand_over(message: Any, sample: Sample) -> None:
            callback(message, ros_time.received_ns(sample.received_ns), names.writer(sample.publisher_gid))

        return self._subscribe(topic, hand_over)

    def totals(self) -> Topics:
        """Running totals for the live rates."""
        return Topics(
            node=self._full_name,
            stamp_ns=time.monotonic_ns(),
            published=_totals([item.figures for item in self._publishers]),
            received=_totals([item.figures for item in self._subscriptions]),
        )

    def reports(self) -> tuple[TopicReport, ...]:
        """Final figures, publishers first."""
        items: list[MessagePublisher | CountingSubscription] = [*self._publishers, *self._subscriptions]
        return tuple(item.figures.report() for item in items)

    def close_subscriptions(self) -> None:
        """Ends reception. No callback runs after the return. Idempotent."""
        while self._open:
            self._open.pop().close()

    def close(self) -> None:
        """Leaves the graph. Idempotent."""
        self.close_subscriptions()
        self._handle.close()

    def _subscribe(self, topic: TopicSpec, hand_over: Callable[[Any, Sample], None]) -> TrafficFigures:
        topic = self._resolve(topic)
        preload((topic.type_name,))
        subscription = CountingSubscription(
            topic, hand_over, self._first, self._on_error, self._log, self._witness
        )
        self._subscriptions.append(subscription)
        self._open.append(
            self._handle.create_subscription(
                topic.name,
                topic.type_name,
                topic.qos,
                subscription.receive,
                on_event=self._reporter(topic),
            )
        )
        return subscription.figures

    def _resolve(self, topic: TopicSpec) -> TopicSpec:
        if topic.name.startswith("~/"):
            return topic.model_copy(update={"name": f"{self._full_name}/{topic.name[2:]}"})
        return topic

    def _first(self, topic: TopicSpec, now_ns: int) -> None:
        self._send(FirstMessage(node=self._full_name, topic=topic.name, stamp_ns=now_ns))

    def _reporter(self, topic: TopicSpec) -> Callable[[str, str], None]:
        def report(event: str, detail: str) -> None:
            self._log.warning("%s: %s: %s", topic.name, event, detail)

        return report


def _totals(figures: list[TrafficFigures]) -> dict[str, int]:
    totals: dict[str, int] = {}
    for item in figures:
        totals[item.topic.name] = totals.get(item.topic.name, 0) + item.count
    return totals

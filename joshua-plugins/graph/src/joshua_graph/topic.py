"""``joshua topic``: list, show and publish the topics of any running ROS 2 graph."""

from __future__ import annotations

import argparse
import contextlib
import itertools
import math
import os
import queue
import statistics
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from joshua.tools import ExitCode, GraphError, add_timeout

from joshua_graph.graph import (
    add_graph_options,
    endpoint_lines,
    find_topic,
    full_topic,
    graph_session,
    looks,
    profile_for,
    run_graph_command,
    show,
    type_name,
    type_of,
    visible_nodes,
)

if TYPE_CHECKING:
    from joshua.api.transports import Publisher, QosProfile, Sample, Subscription, Transport

_ECHO_DEPTH = 100
#: Most received messages that wait to be printed; the oldest are dropped.
_WAITING = 1000
_TICK_S = 0.1
#: How long a command with a count waits for a message; otherwise it waits indefinitely.
_BOUNDED_WAIT_S = 10.0
_HZ_DEPTH = 1000
_HZ_PERIOD_S = 1.0
_POLL_S = 0.01
_LEAVE_S = 0.2
# No ROS 2 message comes close; the YAML parser slows down with every level.
_DEEPEST = 50

SUMMARY = "list, show and publish topics of a running graph"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the subcommands."""
    actions = parser.add_subparsers(dest="topic_action", metavar="ACTION", required=True, title="actions")

    def add(name: str, summary: str, command: Callable[[argparse.Namespace], int]) -> argparse.ArgumentParser:
        action: argparse.ArgumentParser = actions.add_parser(name, help=summary, description=summary)
        add_graph_options(action)
        action.set_defaults(graph_command=command)
        if name != "list":
            action.add_argument("topic", metavar="TOPIC", help="topic name, such as /leader/joint_states")
        return action

    action = add("list", "list the topics", list_topics)
    action.add_argument("-t", "--types", action="store_true", help="show the type of each topic")
    add("info", "show type, hash, publishers and subscriptions of a topic", info)
    action = add("echo", "print the messages of a topic", echo)
    action.add_argument("--type", metavar="TYPE", help="type, if the topic has no publisher yet")
    action.add_argument("-n", "--count", metavar="N", type=_positive, help="end after this many messages")
    action.add_argument("--once", action="store_true", help="end after the first message")
    add_timeout(
        action,
        "give up after this time without a message (default 10 with --once or --count, else never)",
        None,
    )
    action.add_argument("--full", action="store_true", help="show every value of long arrays")
    action = add("hz", "show the rate of a topic, each second", hz)
    action.add_argument(
        "--window", metavar="N", type=_positive, default=1000, help="messages in the average (default 1000)"
    )
    action.add_argument("-n", "--count", metavar="N", type=_positive, help="end after this many lines")
    action = add("pub", "publish a message, once or at a rate", pub)
    action.add_argument("type", metavar="TYPE", help="package/msg/Type or a DataType such as JOINT_STATE")
    action.add_argument(
        "values",
        metavar="VALUES",
        nargs="?",
        default="{}",
        help="fields as YAML or JSON, such as '{data: hello}'; a header may be auto, a stamp now",
    )
    pace = action.add_mutually_exclusive_group()
    pace.add_argument("--once", action="store_true", help="publish once, to a subscription")
    pace.add_argument("--rate", metavar="HZ", type=_rate, default=1.0, help="messages per second (default 1)")
    action.add_argument(
        "-n",
        "--count",
        metavar="N",
        type=_positive,
        help="end after this many messages to a subscription",
    )
    action.add_argument(
        "--latch", action="store_true", help="keep the last message for late subscriptions (TRANSIENT_LOCAL)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the chosen action; Ctrl-C ends a continuous one without an error."""
    try:
        return run_graph_command(arguments)
    except KeyboardInterrupt:
        return ExitCode.OK


def _positive(text: str) -> int:
    if not text.isascii() or not text.isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"expected a whole number of at least 1, found {text!r}")
    return int(text)


def _rate(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and 0 < value <= 10_000):
        raise argparse.ArgumentTypeError(
            f"expected messages per second, above 0 and up to 10000, found {text!r}"
        )
    return value


def list_topics(arguments: argparse.Namespace) -> int:
    """Print the topics, one per line, with their types if requested."""
    with graph_session(arguments) as transport:
        topics: dict[str, set[str]] = {}
        for node in visible_nodes(transport, arguments.wait):
            for endpoint in node.endpoints:
                topics.setdefault(endpoint.topic, set()).add(endpoint.type_name)
        for topic in sorted(topics):
            types = f"  {', '.join(sorted(topics[topic]))}" if arguments.types else ""
            show([f"{topic}{types}"])
    return ExitCode.OK


def info(arguments: argparse.Namespace) -> int:
    """Print the graph's information on one topic."""
    topic = full_topic(arguments.topic)
    with graph_session(arguments) as transport:
        endpoints = find_topic(transport, topic, arguments.wait)
        lines = [topic]
        for name, type_hash in sorted({(end.type_name, end.type_hash) for end in endpoints}):
            lines += [f"type: {name}", f"hash: {type_hash or 'none given'}"]
        lines += endpoint_lines(endpoints, of_node=False)
        show(lines)
    return ExitCode.OK


def echo(arguments: argparse.Namespace) -> int:
    """Print messages until the count is reached or the user stops it."""
    from joshua.messages import MessageError, decode
    from joshua.messages.text import message_text

    topic = full_topic(arguments.topic)
    wanted, shown = 1 if arguments.once else arguments.count, 0
    timeout_s = arguments.timeout or (_BOUNDED_WAIT_S if wanted else None)
    with graph_session(arguments) as transport:
        # an explicit type also serves a topic without a publisher
        publishers = [] if arguments.type else find_topic(transport, topic, arguments.wait)
        chosen = type_name(arguments.type) if arguments.type else type_of(publishers)
        qos = profile_for(publishers, _ECHO_DEPTH)
        for arrival in arrivals(transport, topic, chosen, qos, timeout_s):
            if arrival is None:
                continue
            try:
                text = message_text(decode(chosen, arrival.cdr), full=arguments.full)
            except MessageError as error:
                sys.stderr.write(f"joshua topic: {error}\n")
                continue
            show([*text.splitlines(), "---"])
            sys.stdout.flush()
            shown += 1
            if shown == wanted:
                break
    return ExitCode.OK


def hz(arguments: argparse.Namespace) -> int:
    """Print the rate each second until the user stops it."""
    topic = full_topic(arguments.topic)
    times_s: deque[float] = deque(maxlen=arguments.window)
    with graph_session(arguments) as transport:
        endpoints = find_topic(transport, topic, arguments.wait)
        next_s, fresh, shown = time.monotonic() + _HZ_PERIOD_S, 0, 0
        for arrival in arrivals(transport, topic, type_of(endpoints), profile_for(endpoints, _HZ_DEPTH)):
            if arrival is not None:
                times_s.append(arrival.time_s)
                fresh += 1
            now_s = time.monotonic()
            if now_s < next_s:
                continue
            sys.stdout.write(f"{rate_text(list(times_s)) if fresh else 'no messages'}\n")
            sys.stdout.flush()
            next_s, fresh, shown = now_s + _HZ_PERIOD_S, 0, shown + 1
            if shown == arguments.count:
                break
    return ExitCode.OK


def rate_text(times_s: list[float]) -> str:
    """Format rate and periods of messages that arrived at these times."""
    if len(times_s) < 2:
        return "one message"
    periods_s = [later - sooner for sooner, later in itertools.pairwise(times_s)]
    span_s = times_s[-1] - times_s[0]
    rate_hz = len(periods_s) / span_s if span_s else math.inf
    return (
        f"{rate_hz:.2f} Hz  period {min(periods_s) * 1e3:.1f} to {max(periods_s) * 1e3:.1f} ms  "
        f"deviation {statistics.pstdev(periods_s) * 1e3:.2f} ms  messages {len(times_s)}"
    )


def pub(arguments: argparse.Namespace) -> int:
    """Publish until the count is reached or the user stops it.

    Raises:
        GraphError: a counted message has no subscription in time.
        MessageError: type or values do not fit.
    """
    from joshua.api.transports import QosProfile
    from joshua.messages import encode
    from joshua.messages.fields import build

    topic, chosen = full_topic(arguments.topic), type_name(arguments.type)
    values = read_values(arguments.values)
    build(chosen, values)  # before the graph is joined
    qos = QosProfile(durability="TRANSIENT_LOCAL", depth=1) if arguments.latch else QosProfile()
    count = 1 if arguments.once else arguments.count
    with graph_session(arguments) as transport:
        node = transport.create_node(f"_joshua_{os.getpid()}")
        publisher = node.create_publisher(topic, chosen, qos)
        if count and not arguments.latch:
            _wait_for_subscription(publisher, topic, arguments.wait)
        next_s, sent = time.monotonic(), 0
        while count is None or sent < count:
            # stamps that are "now" are renewed for each message
            publisher.publish(encode(build(chosen, values)))
            sent += 1
            sys.stdout.write(f"published {chosen} on {topic}: {sent}\n")
            sys.stdout.flush()
            if sent != count:
                next_s += 1 / arguments.rate
                time.sleep(max(0.0, next_s - time.monotonic()))
        time.sleep(_LEAVE_S)  # until the last message has been sent
    return ExitCode.OK


def _wait_for_subscription(publisher: Publisher, topic: str, wait_s: float) -> None:
    for _ in looks(wait_s, _POLL_S):
        if publisher.subscription_count:
            return
    raise GraphError(
        f"{topic} had no subscription within {wait_s:g} s, so nothing was published. Wait longer with "
        "--wait, or keep the message for late subscriptions with --latch"
    )


def read_values(text: str) -> Any:
    """Parse the values of a message: YAML, of which JSON is a part.

    Raises:
        MessageError: the text is neither; the message has line and column.
    """
    from joshua.messages import MessageError

    depths = itertools.accumulate((letter in "[{") - (letter in "]}") for letter in text)
    if max(depths, default=0) > _DEEPEST:
        raise MessageError(f"the values cannot be read: they are nested more than {_DEEPEST} deep")
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    try:
        return YAML(typ="safe", pure=True).load(text)
    except YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        place = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
        problem = getattr(error, "problem", None) or str(error).splitlines()[0]
        raise MessageError(
            f"the values cannot be read: {place}{problem}; write YAML or JSON, such as '{{x: 1.0, y: 2.0}}'"
        ) from error
    except ValueError as error:
        raise MessageError(f"the values cannot be read: {error}") from error


@dataclass(frozen=True)
class Arrival:
    """A received payload and its time on the monotonic clock."""

    cdr: Any
    time_s: float


def arrivals(
    transport: Transport, topic: str, type_name: str, qos: QosProfile, timeout_s: float | None = None
) -> Iterator[Arrival | None]:
    """Subscribe; yield what is received, and None about ten times per second without messages.

    They are handled on the main thread, where Ctrl-C and a closed pipe arrive. Standard error reports when
    the last publisher leaves, and when there is one again.

    Raises:
        GraphError: no message was received for ``timeout_s``.
    """
    waiting: queue.Queue[Arrival] = queue.Queue(_WAITING)

    def callback(sample: Sample) -> None:
        arrival = Arrival(sample.cdr, time.monotonic())
        with contextlib.suppress(queue.Empty):
            if waiting.full():
                waiting.get_nowait()
        waiting.put_nowait(arrival)

    node = transport.create_node(f"_joshua_{os.getpid()}")
    publishers = _Publishers(node.create_subscription(topic, type_name, qos, callback), topic)
    silent_s = 0.0
    while True:
        try:
            arrival = waiting.get(timeout=_TICK_S)
            silent_s = 0.0
            publishers.received()
            yield arrival
        except queue.Empty:
            publishers.look()
            silent_s += _TICK_S  # not from the clock, which continues while this program is stopped
            if timeout_s is not None and silent_s >= timeout_s:
                raise GraphError(
                    f"no message received on {topic} within {timeout_s:g} s: {publishers.state}. Wait longer "
                    "with --timeout"
                ) from None
            yield None


class _Publishers:
    """Tracks the publishers of a topic."""

    def __init__(self, subscription: Subscription, topic: str) -> None:
        self._subscription, self._topic = subscription, topic
        # counts a publisher that leaves before the first look, or during uninterrupted messages
        self._count = self._most = subscription.publisher_count

    def look(self) -> None:
        """Report when the last one has left, and when there is one again."""
        before, self._count = self._count, self._subscription.publisher_count
        if before and not self._count:
            sys.stderr.write(
                f"the last publisher of {self._topic} has left; waiting for another (Ctrl-C ends)\n"
            )
        elif self._count and not before and self._most:
            sys.stderr.write(f"{self._topic} has a publisher again\n")
        self._most = max(self._most, self._count)

    def received(self) -> None:
        """Note a received message, perhaps from a publisher that no look has found yet."""
        if not self._count:
            self.look()

    @property
    def state(self) -> str:
        """Describe why no message may have been received."""
        if self._count:
            return f"its {self._count} publisher{'s' * (self._count > 1)} sent none"
        return "its last publisher has left" if self._most else "it has no publisher"

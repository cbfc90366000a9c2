"""The actions of ``joshua topic``."""

from __future__ import annotations

import itertools
import os
import statistics
import sys
import time
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from joshua.cli.exit_codes import ExitCode
from joshua.cli.graph.describe import topic_lines
from joshua.cli.graph.listening import arrivals
from joshua.cli.graph.lookup import find_topic, full_topic, profile_for, type_name, type_of
from joshua.cli.graph.session import GraphError, graph_session, looks, say_if_empty, wait_for_graph

if TYPE_CHECKING:
    import argparse

    from joshua.transport import Publisher


def list_topics(arguments: argparse.Namespace) -> int:
    """Prints the topics, one a line, with their types where asked."""
    with graph_session(arguments) as transport:
        nodes = wait_for_graph(transport, arguments.wait)
        say_if_empty(transport, nodes)
        topics: dict[str, set[str]] = {}
        for node in nodes:
            for endpoint in node.endpoints:
                topics.setdefault(endpoint.topic, set()).add(endpoint.type_name)
        for topic in sorted(topics):
            types = f"  {', '.join(sorted(topics[topic]))}" if arguments.types else ""
            sys.stdout.write(f"{topic}{types}\n")
    return 0


def info(arguments: argparse.Namespace) -> int:
    """Prints what the graph knows of one topic."""
    topic = full_topic(arguments.topic)
    with graph_session(arguments) as transport:
        endpoints = find_topic(transport, topic, arguments.wait)
        sys.stdout.write("\n".join(topic_lines(topic, endpoints)) + "\n")
    return 0


_ECHO_DEPTH = 100
#: Who asks for a number of messages waits for an end; a topic may be silent for ever.
_BOUNDED_WAIT_S = 10.0


def echo(arguments: argparse.Namespace) -> int:
    """Prints messages until the count is reached or the user stops it."""
    from joshua.messages import MessageError, decode
    from joshua.messages.text import message_text

    topic = full_topic(arguments.topic)
    wanted, shown = 1 if arguments.once else arguments.count, 0
    timeout_s = arguments.timeout or (_BOUNDED_WAIT_S if wanted else None)
    try:
        with graph_session(arguments) as transport:
            if arguments.type:
                # an explicit type also serves a topic that nobody publishes yet
                chosen, publishers = type_name(arguments.type), []
            else:
                publishers = find_topic(transport, topic, arguments.wait)
                chosen = type_name(type_of(publishers))
            for arrival in arrivals(
                transport, topic, chosen, profile_for(publishers, _ECHO_DEPTH), timeout_s
            ):
                if arrival is None:
                    continue
                try:
                    text = message_text(decode(chosen, arrival.cdr), full=arguments.full)
                except MessageError as error:
                    sys.stderr.write(f"joshua topic: {error}\n")
                    continue
                sys.stdout.write(f"{text}---\n")
                sys.stdout.flush()
                shown += 1
                if shown == wanted:
                    break
    except KeyboardInterrupt:
        return 0
    return 0


_HZ_DEPTH = 1000
_HZ_PERIOD_S = 1.0


def hz(arguments: argparse.Namespace) -> int:
    """Prints the rate each second until the user stops it."""
    topic = full_topic(arguments.topic)
    meter = RateMeter(arguments.window)
    try:
        with graph_session(arguments) as transport:
            endpoints = find_topic(transport, topic, arguments.wait)
            chosen = type_name(type_of(endpoints))
            next_s, fresh, shown = time.monotonic() + _HZ_PERIOD_S, 0, 0
            for arrival in arrivals(transport, topic, chosen, profile_for(endpoints, _HZ_DEPTH)):
                if arrival is not None:
                    meter.arrived(arrival.time_s)
                    fresh += 1
                now_s = time.monotonic()
                if now_s < next_s:
                    continue
                rate = meter.rate() if fresh else None
                sys.stdout.write(f"{rate or ('one message' if fresh else 'no messages')}\n")
                sys.stdout.flush()
                next_s, fresh, shown = now_s + _HZ_PERIOD_S, 0, shown + 1
                if shown == arguments.count:
                    break
    except KeyboardInterrupt:
        return 0
    return 0


_POLL_S = 0.01
_LEAVE_S = 0.2


def pub(arguments: argparse.Namespace) -> int:
    """Publishes until the count is reached or the user stops it.

    Raises:
        GraphError: nobody listened in time to a message that is sent once.
        MessageError: type or values do not fit.
    """
    from joshua.messages import encode
    from joshua.messages.fields import build
    from joshua.plan import QosProfile

    topic, chosen = full_topic(arguments.topic), type_name(arguments.type)
    values = read_values(arguments.values)
    build(chosen, values)  # before anything is opened
    qos = QosProfile(durability="TRANSIENT_LOCAL", depth=1) if arguments.latch else QosProfile()
    count = 1 if arguments.once else arguments.count
    try:
        with graph_session(arguments) as transport:
            node = transport.create_node(f"_joshua_{os.getpid()}")
            publisher = node.create_publisher(topic, chosen, qos)
            if arguments.once and not arguments.latch:
                _wait_for_subscription(publisher, topic, arguments.wait)
            next_s, sent = time.monotonic(), 0
            while count is None or sent < count:
                # stamps that are «now» are made anew for each message
                publisher.publish(encode(build(chosen, values)))
                sent += 1
                sys.stdout.write(f"published {chosen} on {topic}: {sent}\n")
                sys.stdout.flush()
                if sent != count:
                    next_s += 1 / arguments.rate
                    time.sleep(max(0.0, next_s - time.monotonic()))
            time.sleep(_LEAVE_S)  # what was handed over leaves before the connection closes
    except KeyboardInterrupt:
        return ExitCode.OK
    return ExitCode.OK


def _wait_for_subscription(publisher: Publisher, topic: str, wait_s: float) -> None:
    for _ in looks(wait_s, _POLL_S):
        if publisher.subscription_count:
            return
    raise GraphError(
        f"nobody subscribed to {topic} within {wait_s:g} s, so nothing was published; wait longer "
        "with --wait, or keep the message for late subscriptions with --latch and --rate"
    )


@dataclass(frozen=True)
class Rate:
    """Figures of one window; periods in seconds."""

    rate_hz: float
    shortest_s: float
    longest_s: float
    deviation_s: float
    count: int

    def __str__(self) -> str:
        return (
            f"{self.rate_hz:.2f} Hz  period {self.shortest_s * 1e3:.1f} to {self.longest_s * 1e3:.1f} ms  "
            f"deviation {self.deviation_s * 1e3:.2f} ms  messages {self.count}"
        )


class RateMeter:
    """Collects arrival times.

    Args:
        window: messages that count, at most.
    """

    def __init__(self, window: int) -> None:
        self._arrivals_s: deque[float] = deque(maxlen=window)

    def arrived(self, time_s: float) -> None:
        """Takes in one arrival on the monotonic clock."""
        self._arrivals_s.append(time_s)

    def rate(self) -> Rate | None:
        """The figures; None with fewer than two arrivals."""
        times_s = list(self._arrivals_s)
        if len(times_s) < 2:
            return None
        periods_s = [later - sooner for sooner, later in itertools.pairwise(times_s)]
        span_s = times_s[-1] - times_s[0]
        return Rate(
            rate_hz=len(periods_s) / span_s if span_s else float("inf"),
            shortest_s=min(periods_s),
            longest_s=max(periods_s),
            deviation_s=statistics.pstdev(periods_s),
            count=len(times_s),
        )


# No message of ROS 2 comes near; the YAML parser slows down with every level.
_DEEPEST = 50


def read_values(text: str) -> Any:
    """Parses the values of a message: YAML, of which JSON is a part.

    Raises:
        MessageError: the text is neither; line and column stand in the message.
    """
    from joshua.messages import MessageError

    if _depth(text) > _DEEPEST:
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


def _depth(text: str) -> int:
    """How deep brackets are nested, those in quotes included."""
    deepest = depth = 0
    for letter in text:
        depth += (letter in "[{") - (letter in "]}")
        deepest = max(deepest, depth)
    return deepest

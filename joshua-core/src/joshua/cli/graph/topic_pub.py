"""``joshua topic pub``."""

from __future__ import annotations

import os
import sys
import time
from typing import TYPE_CHECKING

from joshua.cli.exit_codes import ExitCode
from joshua.cli.graph.lookup import full_topic, type_name
from joshua.cli.graph.payload import read_values
from joshua.cli.graph.session import GraphError, graph_session, looks

if TYPE_CHECKING:
    import argparse

    from joshua.transport import Publisher

_POLL_S = 0.01
_LEAVE_S = 0.2


def run(arguments: argparse.Namespace) -> int:
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

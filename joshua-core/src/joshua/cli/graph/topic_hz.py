"""``joshua topic hz``."""

from __future__ import annotations

import sys
import time
from typing import TYPE_CHECKING

from joshua.cli.graph.listening import arrivals
from joshua.cli.graph.lookup import find_topic, full_topic, profile_for, type_name, type_of
from joshua.cli.graph.rates import RateMeter
from joshua.cli.graph.session import graph_session

if TYPE_CHECKING:
    import argparse

_DEPTH = 1000
_PERIOD_S = 1.0


def run(arguments: argparse.Namespace) -> int:
    """Prints the rate each second until the user stops it."""
    topic = full_topic(arguments.topic)
    meter = RateMeter(arguments.window)
    try:
        with graph_session(arguments) as transport:
            endpoints = find_topic(transport, topic, arguments.wait)
            chosen = type_name(type_of(endpoints))
            next_s, fresh, shown = time.monotonic() + _PERIOD_S, 0, 0
            for arrival in arrivals(transport, topic, chosen, profile_for(endpoints, _DEPTH)):
                if arrival is not None:
                    meter.arrived(arrival.time_s)
                    fresh += 1
                now_s = time.monotonic()
                if now_s < next_s:
                    continue
                rate = meter.rate() if fresh else None
                sys.stdout.write(f"{rate or ('one message' if fresh else 'no messages')}\n")
                sys.stdout.flush()
                next_s, fresh, shown = now_s + _PERIOD_S, 0, shown + 1
                if shown == arguments.count:
                    break
    except KeyboardInterrupt:
        return 0
    return 0

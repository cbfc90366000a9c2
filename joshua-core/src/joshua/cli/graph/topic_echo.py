"""``joshua topic echo``."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from joshua.cli.graph.listening import arrivals
from joshua.cli.graph.lookup import find_topic, full_topic, profile_for, type_name, type_of
from joshua.cli.graph.session import graph_session

if TYPE_CHECKING:
    import argparse

_DEPTH = 100
#: Who asks for a number of messages waits for an end; a topic may be silent for ever.
_BOUNDED_WAIT_S = 10.0


def run(arguments: argparse.Namespace) -> int:
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
            for arrival in arrivals(transport, topic, chosen, profile_for(publishers, _DEPTH), timeout_s):
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

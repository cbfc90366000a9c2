"""``joshua topic list``."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from joshua.cli.graph.session import graph_session, say_if_empty, wait_for_graph

if TYPE_CHECKING:
    import argparse


def run(arguments: argparse.Namespace) -> int:
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

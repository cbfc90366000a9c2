"""``joshua topic info``."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from joshua.cli.graph.describe import topic_lines
from joshua.cli.graph.lookup import find_topic, full_topic
from joshua.cli.graph.session import graph_session

if TYPE_CHECKING:
    import argparse


def run(arguments: argparse.Namespace) -> int:
    """Prints what the graph knows of one topic."""
    topic = full_topic(arguments.topic)
    with graph_session(arguments) as transport:
        endpoints = find_topic(transport, topic, arguments.wait)
        sys.stdout.write("\n".join(topic_lines(topic, endpoints)) + "\n")
    return 0

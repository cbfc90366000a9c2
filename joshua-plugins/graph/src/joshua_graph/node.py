"""``joshua node``: list the nodes of any running ROS 2 graph."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from joshua_graph.graph import (
    add_graph_options,
    endpoint_lines,
    find_node,
    full_name,
    full_topic,
    graph_session,
    run_graph_command,
    show,
    visible_nodes,
)

if TYPE_CHECKING:
    import argparse

SUMMARY = "list the nodes of a running graph"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the subcommands."""
    actions = parser.add_subparsers(dest="node_action", metavar="ACTION", required=True, title="actions")
    listing = actions.add_parser("list", help="list the nodes", description="list the nodes")
    listing.add_argument("-a", "--all", action="store_true", help="show hidden nodes (with a leading _) too")
    listing.set_defaults(graph_command=_list)
    summary = "show the publishers and subscriptions of a node"
    info = actions.add_parser("info", help=summary, description=summary)
    info.add_argument("node", metavar="NODE", help="node name, such as /leader_arm")
    info.set_defaults(graph_command=_info)
    for action in (listing, info):
        add_graph_options(action)


run = run_graph_command


def _list(arguments: argparse.Namespace) -> int:
    with graph_session(arguments) as transport:
        nodes = visible_nodes(transport, arguments.wait, hidden=arguments.all)
        sys.stdout.writelines(f"{name}\n" for name in sorted(map(full_name, nodes)))
    return 0


def _info(arguments: argparse.Namespace) -> int:
    name = full_topic(arguments.node)
    with graph_session(arguments) as transport:
        for node in find_node(transport, name, arguments.wait):
            lines = [name, *endpoint_lines(node.endpoints, of_node=True)]
            show(lines)
    return 0

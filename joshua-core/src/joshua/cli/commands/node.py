"""``joshua node``: list the nodes of any running ROS 2 graph."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import argparse


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the subcommands."""
    from joshua.cli.graph.session import add_graph_options

    actions = parser.add_subparsers(dest="node_action", metavar="ACTION", required=True, title="actions")
    listing = actions.add_parser("list", help="list the nodes", description="list the nodes")
    listing.add_argument("-a", "--all", action="store_true", help="show hidden nodes (with a leading _) too")
    listing.set_defaults(graph_command=_list)
    summary = "show the publishers and subscriptions of a node"
    info = actions.add_parser("info", help=summary, description=summary)
    info.add_argument("node", metavar="NODE", help="node name, such as /leader_arm")
    info.set_defaults(graph_command=_info)
    for parser_of_action in (listing, info):
        add_graph_options(parser_of_action)


def run(arguments: argparse.Namespace) -> int:
    """Runs the chosen action."""
    from joshua.cli.graph.session import run_graph_command

    return run_graph_command(arguments)


def _list(arguments: argparse.Namespace) -> int:
    import sys

    from joshua.cli.graph.lookup import full_name
    from joshua.cli.graph.session import graph_session, say_if_empty, wait_for_graph

    with graph_session(arguments) as transport:
        nodes = wait_for_graph(transport, arguments.wait)
        say_if_empty(transport, nodes)
        names = sorted(full_name(node) for node in nodes if arguments.all or not node.name.startswith("_"))
        sys.stdout.write("".join(f"{name}\n" for name in names))
    return 0


def _info(arguments: argparse.Namespace) -> int:
    import sys

    from joshua.cli.graph.describe import node_lines
    from joshua.cli.graph.lookup import find_node, full_topic
    from joshua.cli.graph.session import graph_session

    name = full_topic(arguments.node)
    with graph_session(arguments) as transport:
        for node in find_node(transport, name, arguments.wait):
            sys.stdout.write("\n".join(node_lines(node, name)) + "\n")
    return 0

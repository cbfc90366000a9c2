"""``joshua topic``: list, watch and feed the topics of any running ROS 2 graph."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import argparse


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the subcommands."""
    actions = parser.add_subparsers(dest="topic_action", metavar="ACTION", required=True, title="actions")
    _list(actions)
    _info(actions)
    _echo(actions)
    _hz(actions)
    _pub(actions)


def run(arguments: argparse.Namespace) -> int:
    """Runs the chosen action."""
    from joshua.cli.graph.session import run_graph_command

    return run_graph_command(arguments)


def _action(actions: Any, name: str, summary: str, function: str = "") -> argparse.ArgumentParser:
    """A subcommand whose code is imported when it runs."""
    from joshua.cli.graph.session import add_graph_options

    parser: argparse.ArgumentParser = actions.add_parser(name, help=summary, description=summary)
    add_graph_options(parser)

    def call(arguments: argparse.Namespace) -> int:
        from joshua.cli.graph import topics

        return int(getattr(topics, function or name)(arguments))

    parser.set_defaults(graph_command=call)
    return parser


def _list(actions: Any) -> None:
    parser = _action(actions, "list", "list the topics", "list_topics")
    parser.add_argument("-t", "--types", action="store_true", help="show the type of each topic")


def _info(actions: Any) -> None:
    parser = _action(actions, "info", "show type, hash, publishers and subscriptions of a topic")
    parser.add_argument("topic", metavar="TOPIC", help="topic name, such as /leader/joint_states")


def _echo(actions: Any) -> None:
    from joshua.cli.options import positive_seconds

    parser = _action(actions, "echo", "print the messages of a topic")
    parser.add_argument("topic", metavar="TOPIC", help="topic name, such as /leader/joint_states")
    parser.add_argument("--type", metavar="TYPE", help="type, where no publisher says it yet")
    parser.add_argument("-n", "--count", metavar="N", type=_positive, help="end after this many messages")
    parser.add_argument("--once", action="store_true", help="end after the first message")
    parser.add_argument(
        "--timeout",
        metavar="SECONDS",
        type=positive_seconds,
        help="give up when no message comes for so long (default 10 with --once or --count, else never)",
    )
    parser.add_argument("--full", action="store_true", help="show every value of long arrays")


def _hz(actions: Any) -> None:
    parser = _action(actions, "hz", "show the rate of a topic, each second")
    parser.add_argument("topic", metavar="TOPIC", help="topic name, such as /camera/image")
    parser.add_argument("--window", metavar="N", type=_positive, default=1000, help="messages that count")
    parser.add_argument("-n", "--count", metavar="N", type=_positive, help="end after this many lines")


def _pub(actions: Any) -> None:
    parser = _action(actions, "pub", "publish a message, once or at a rate")
    parser.add_argument("topic", metavar="TOPIC", help="topic name, such as /follower/joint_states")
    parser.add_argument("type", metavar="TYPE", help="package/msg/Type or a DataType such as JOINT_STATE")
    parser.add_argument(
        "values",
        metavar="VALUES",
        nargs="?",
        default="{}",
        help="fields as YAML or JSON, such as '{data: hello}'; a header may be auto, a stamp now",
    )
    pace = parser.add_mutually_exclusive_group()
    pace.add_argument("--once", action="store_true", help="publish once, when somebody listens")
    pace.add_argument("--rate", metavar="HZ", type=_rate, default=1.0, help="messages a second (default 1)")
    parser.add_argument("-n", "--count", metavar="N", type=_positive, help="end after this many messages")
    parser.add_argument(
        "--latch", action="store_true", help="keep the last message for late subscriptions (TRANSIENT_LOCAL)"
    )


def _positive(text: str) -> int:
    import argparse

    if not text.isascii() or not text.isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"expected a whole number from 1 on, found {text!r}")
    return int(text)


def _rate(text: str) -> float:
    import argparse
    import math

    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and 0 < value <= 10_000):
        raise argparse.ArgumentTypeError(f"expected messages a second from above 0 to 10000, found {text!r}")
    return value

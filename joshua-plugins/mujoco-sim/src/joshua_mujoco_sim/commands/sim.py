"""``joshua sim``: pause, step, reset and set the state of a running simulation."""

from __future__ import annotations

import argparse
import contextlib
import os
import queue
import sys
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from joshua.plan import TopicSpec
    from joshua.transport import Sample

SUMMARY = "pause, step, reset or set the state of a running simulation"

#: How long the simulation may take to answer; it does so on /rosout.
_ANSWER_S = 10.0

_WARNING = 30


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the actions and options of ``joshua sim``."""
    from joshua.cli.graph.session import add_graph_options

    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    for name, text in (
        ("pause", "let simulated time stand still"),
        ("resume", "let simulated time run on"),
        ("reset", "put the model back to its start"),
    ):
        add_graph_options(_with_node(actions.add_parser(name, help=text)))
    step = _with_node(actions.add_parser("step", help="do some steps while paused"))
    step.add_argument("count", type=int, nargs="?", default=1, help="number of steps")
    add_graph_options(step)
    state = _with_node(actions.add_parser("set", help="put joints somewhere, at rest"))
    state.add_argument("joints", nargs="+", metavar="JOINT=RADIANS", type=_joint, help="such as gripper=0.5")
    add_graph_options(state)
    parser.set_defaults(graph_command=send)


def run(arguments: argparse.Namespace) -> int:
    """Sends one request. Exit code 0; 1 where no simulation listens."""
    from joshua.cli.graph.session import run_graph_command

    return run_graph_command(arguments)


def send(arguments: argparse.Namespace) -> int:
    """Publishes the request once a simulation listens, and says what it answers. Raises GraphError."""
    from joshua.cli.exit_codes import ExitCode
    from joshua.cli.graph.session import GraphError, graph_session
    from joshua.messages import encode
    from joshua.node.rosout import ROSOUT_QOS

    topic, message = _request(arguments)
    name = topic.name.replace("~", arguments.node.rstrip("/"), 1)
    with graph_session(arguments) as transport:
        node = transport.create_node(f"_joshua_{os.getpid()}")
        answers: queue.Queue[tuple[int, int, str]] = queue.Queue()
        take = _answer_taker(answers, arguments.node, topic.name)
        node.create_subscription("/rosout", "rcl_interfaces/msg/Log", ROSOUT_QOS, take)
        publisher = node.create_publisher(name, topic.type_name, topic.qos)
        end_s = time.monotonic() + arguments.wait
        while not publisher.subscription_count:
            if time.monotonic() >= end_s:
                raise GraphError(
                    f"no simulation listens on {name} within {arguments.wait:g} s: start one, or name its "
                    "node with --node; joshua node list shows what runs"
                )
            time.sleep(0.01)
        sent_ns = time.time_ns()
        publisher.publish(encode(message))
        level, text = _newest_answer(answers, sent_ns)
    if level >= _WARNING:
        raise GraphError(text)
    sys.stdout.write(f"{text}\n")
    return ExitCode.OK


def _newest_answer(answers: queue.Queue[tuple[int, int, str]], sent_ns: int) -> tuple[int, str]:
    """The first answer that is not older than the request; /rosout keeps those of the last seconds."""
    end_s = time.monotonic() + _ANSWER_S
    while (left_s := end_s - time.monotonic()) > 0:
        with contextlib.suppress(queue.Empty):
            stamp_ns, level, text = answers.get(timeout=left_s)
            if stamp_ns >= sent_ns:
                return level, text
    return 0, f"sent, and no answer came within {_ANSWER_S:g} s; the log of the run says what became of it"


def _answer_taker(
    answers: queue.Queue[tuple[int, int, str]], node: str, topic: str
) -> Callable[[Sample], None]:
    """Takes what a node logs about one of its topics."""
    from joshua.messages import decode

    logger = node.strip("/").replace("/", ".")

    def take(sample: Sample) -> None:
        message = decode("rcl_interfaces/msg/Log", sample.cdr)
        start = f"{topic}: "
        if message.name == logger and message.msg.startswith(start):
            stamp_ns = message.stamp.sec * 1_000_000_000 + message.stamp.nanosec
            answers.put((stamp_ns, int(message.level), message.msg.removeprefix(start)))

    return take


def _request(arguments: argparse.Namespace) -> tuple[TopicSpec, Any]:
    import numpy as np
    from joshua.messages import message_class
    from joshua.messages.make import joint_state

    from joshua_mujoco_sim import control_topics as topics

    if arguments.action in ("pause", "resume"):
        return topics.PAUSE, message_class(topics.PAUSE.type_name)(arguments.action == "pause")
    if arguments.action == "step":
        return topics.STEP, message_class(topics.STEP.type_name)(arguments.count)
    if arguments.action == "set":
        names = [name for name, _ in arguments.joints]
        return topics.SET_STATE, joint_state(names, np.array([value for _, value in arguments.joints]))
    return topics.RESET, message_class(topics.RESET.type_name)()


def _with_node(parser: argparse.ArgumentParser) -> argparse.ArgumentParser:
    parser.add_argument(
        "--node", default="/simulation", metavar="NAME", help="the simulator's node (default /simulation)"
    )
    return parser


def _joint(text: str) -> tuple[str, float]:
    name, equals, value = text.partition("=")
    try:
        if not (name and equals):
            raise ValueError
        return name, float(value)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}: expected JOINT=RADIANS, such as gripper=0.5") from None

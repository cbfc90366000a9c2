"""A short visit to the ROS 2 graph: choosing the transport, joining, waiting until the graph is known."""

from __future__ import annotations

import contextlib
import os
import sys
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

from joshua.cli.exit_codes import ExitCode

if TYPE_CHECKING:
    import argparse

    from joshua.plan import TransportSettings
    from joshua.transport import NodeInfo, Transport

_QUIET_S = 0.3
_POLL_S = 0.02


class GraphError(Exception):
    """A command about the graph cannot go on.

    Attributes:
        code: exit code.
    """

    def __init__(self, message: str, code: ExitCode = ExitCode.FAILED) -> None:
        super().__init__(message)
        self.code = code


def add_graph_options(parser: argparse.ArgumentParser) -> None:
    """Adds the options that every command about the graph takes."""
    from joshua.cli.options import positive_seconds

    group = parser.add_argument_group("graph")
    group.add_argument(
        "--transport",
        metavar="NAME",
        default="",
        help="zenoh, dds or one of a plugin (default: RMW_IMPLEMENTATION, a sourced ROS 2, else zenoh)",
    )
    # absent options stay out of the namespace, so that `joshua --config FILE topic list` works as well
    group.add_argument(
        "--config",
        metavar="PATH",
        default=_suppress(),
        help="take the transport block of this configuration file",
    )
    group.add_argument(
        "--wait",
        metavar="SECONDS",
        type=positive_seconds,
        default=2.0,
        help="how long to look for nodes and topics, at most (default 2)",
    )


def run_graph_command(arguments: argparse.Namespace) -> int:
    """Runs the chosen subcommand; turns what cannot go on into a message and an exit code."""
    from joshua.messages import MessageError
    from joshua.plugins.targets import TargetError
    from joshua.transport import TransportError

    try:
        return int(arguments.graph_command(arguments))
    except GraphError as error:
        text, code = str(error), error.code
    except TargetError as error:
        text, code = str(error), ExitCode.NOT_INSTALLED
    except TransportError as error:
        text, code = str(error), ExitCode.FAILED
    except MessageError as error:
        text, code = str(error), ExitCode.INVALID
    sys.stderr.write(f"joshua {arguments.command}: {text}\n")
    return code


@contextlib.contextmanager
def graph_session(arguments: argparse.Namespace) -> Iterator[Transport]:
    """Joins the graph for the length of the block.

    Raises:
        GraphError: no router answers, the environment is invalid or the file cannot be read.
    """
    from joshua.transport import open_transport

    transport = open_transport(choose_settings(arguments))
    try:
        _require_connection(transport, arguments.wait)
        yield transport
    finally:
        transport.close()


def choose_settings(arguments: argparse.Namespace) -> TransportSettings:
    """The transport of the command line, the file or the environment.

    Raises:
        GraphError: the environment is invalid, the file cannot be read or the transport is not installed.
    """
    from joshua.plugins import load_registry
    from joshua.schema.transport_pb2 import TransportConfig
    from joshua.transport.choice import TransportChoiceError, choose_transport, why_missing

    path, option = getattr(arguments, "config", None), arguments.transport
    try:
        if path:
            settings = _settings_of_file(path, option)
        else:
            settings = choose_transport(TransportConfig(), os.environ, load_registry, option=option)
    except TransportChoiceError as error:
        raise GraphError(str(error), ExitCode.INVALID) from error
    if not settings.implementation:
        raise GraphError(". ".join(why_missing(settings, load_registry())), ExitCode.NOT_INSTALLED)
    return settings


def looks(wait_s: float, pause_s: float = _POLL_S) -> Iterator[None]:
    """Yields for each look at something that is waited for; the last one comes after the whole wait.

    A pause in which this program stood still counts little: what it waits for could not come in either.
    """
    left_s = wait_s
    while True:
        yield
        if left_s <= 0:
            return
        began_s = time.monotonic()
        time.sleep(min(pause_s, left_s))
        left_s -= min(time.monotonic() - began_s, 2 * pause_s)


def wait_for_graph(transport: Transport, wait_s: float) -> list[NodeInfo]:
    """The nodes, once nothing new has come for a moment; at the latest after ``wait_s``.

    Endpoints whose node has not announced them yet are waited for.
    """
    from joshua.transport.transports import NAMELESS

    known: list[NodeInfo] = []
    quiet_looks = 0
    for _ in looks(wait_s):
        before, known = known, transport.nodes()
        quiet_looks = quiet_looks + 1 if known == before else 0
        settled = known and all(node.name != NAMELESS for node in known)
        if settled and quiet_looks * _POLL_S >= min(_QUIET_S, wait_s):
            break
    return known


def say_if_empty(transport: Transport, nodes: list[NodeInfo]) -> None:
    """Says on standard error that nobody was found, and what to look at."""
    if nodes:
        return
    settings = transport.settings
    other = "dds" if settings.kind == "zenoh" else "zenoh"
    sys.stderr.write(
        f"no ROS 2 node was found on {place_of(transport)}; nodes of another domain need its ROS_DOMAIN_ID, "
        f"those of the other middleware --transport {other}{_range_hint(settings)}\n"
    )


def _range_hint(settings: TransportSettings) -> str:
    if settings.kind == "dds" and settings.discovery_range == "LOCALHOST":
        return "; ROS 2 nodes with their default range need ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET here"
    return ""


def place_of(transport: Transport) -> str:
    """Where this visit looks: the meeting point and the domain."""
    if transport.settings.kind == "dds":
        return transport.meeting_point
    return f"{transport.meeting_point}, domain {transport.settings.domain_id}"


def _require_connection(transport: Transport, wait_s: float) -> None:
    for _ in looks(wait_s):
        if transport.connected:
            return
    raise GraphError(
        f"no Zenoh router answers on {transport.meeting_point}; start a robot (joshua --config robot.pbtxt) "
        "or ROS 2's router, name the robot's file with --config, or use --transport dds for nodes on DDS"
    )


def _settings_of_file(path: str, option: str) -> TransportSettings:
    from joshua.config import load
    from joshua.config.checks import Context
    from joshua.planner.transport_choice import transport_settings
    from joshua.plugins import load_registry

    loaded = load(path)
    settings, found = transport_settings(Context(loaded, launch=True), load_registry(), option)
    problems = [item for item in (*loaded.diagnostics, *found) if item.severity.value == "error"]
    if not loaded.is_readable or settings is None:
        reason = problems[0].message if problems else "it cannot be read"
        raise GraphError(f"{path}: {reason}; see joshua --config {path} --validate-only", ExitCode.INVALID)
    return settings


def _suppress() -> str:
    import argparse

    return argparse.SUPPRESS

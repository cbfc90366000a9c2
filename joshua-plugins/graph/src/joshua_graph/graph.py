"""Join the ROS 2 graph, and find topics, types and nodes, or name the nearest."""

from __future__ import annotations

import argparse
import contextlib
import difflib
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

from joshua.tools import ExitCode, GraphError, add_config, graph_transport, positive_seconds

if TYPE_CHECKING:
    from joshua.api.transports import EndpointInfo, NodeInfo, QosProfile, Transport, TransportSettings

_QUIET_S = 0.3
_POLL_S = 0.02
_LONGEST_WRAPPED = 10_000  # a picture in full is not wrapped
#: How long the rest of a topic's or node's entries may take to arrive.
_SETTLE_S = 2.0


def add_graph_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of every command on the graph."""
    group = parser.add_argument_group("graph")
    group.add_argument(
        "--transport",
        metavar="NAME",
        default="",
        help="zenoh, dds or one of a plugin (default: RMW_IMPLEMENTATION, a sourced ROS 2, else zenoh)",
    )
    add_config(group, "use the transport block of this configuration file")
    group.add_argument(
        "--wait",
        metavar="SECONDS",
        type=positive_seconds,
        default=2.0,
        help="how long to look for nodes and topics, at most (default 2)",
    )


def run_graph_command(arguments: argparse.Namespace) -> int:
    """Run the chosen subcommand; an error becomes a message and an exit code."""
    from joshua.api.transports import TransportError
    from joshua.messages import MessageError
    from joshua.tools import TargetError

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
    """Join the graph for the length of the block.

    Raises:
        GraphError: no router answers, the environment is invalid or the file cannot be read.
    """
    from joshua.api.transports import open_transport

    transport = open_transport(graph_transport(getattr(arguments, "config", None), arguments.transport))
    try:
        for _ in looks(arguments.wait):
            if transport.connected:
                break
        else:
            raise GraphError(
                f"no Zenoh router answers on {transport.meeting_point}. {_running_hint(transport.settings)}"
                "Start a robot (joshua --config robot.pbtxt) or ROS 2's router, name a running file with "
                "--config, or use --transport dds for nodes on DDS"
            )
        yield transport
    finally:
        transport.close()


def looks(wait_s: float, pause_s: float = _POLL_S) -> Iterator[None]:
    """Yield for each poll of a condition; the last poll comes after the whole wait.

    A pause in which this program was stopped counts little, because the rest of the graph stopped as well.
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
    """Return the nodes, once nothing new has appeared for a moment; at the latest after ``wait_s``.

    Endpoints whose node is not announced yet are waited for.
    """
    from joshua.api.transports import NAMELESS

    known: list[NodeInfo] = []
    quiet_looks = 0
    for _ in looks(wait_s):
        before, known = known, transport.nodes()
        quiet_looks = quiet_looks + 1 if known == before else 0
        settled = known and all(node.name != NAMELESS for node in known)
        if settled and quiet_looks * _POLL_S >= min(_QUIET_S, wait_s):
            break
    return known


def visible_nodes(transport: Transport, wait_s: float, *, hidden: bool = True) -> list[NodeInfo]:
    """Return the nodes of the graph; if there are none, print why and what to do to standard error.

    Args:
        hidden: whether nodes whose name begins with ``_`` count.
    """
    nodes = wait_for_graph(transport, wait_s)
    shown = [node for node in nodes if hidden or not node.name.startswith("_")]
    if nodes and not shown:
        sys.stderr.write("every node of the graph is hidden: its name begins with _. Show them with --all\n")
    elif not nodes:
        settings = transport.settings
        other = "dds" if settings.kind == "zenoh" else "zenoh"
        wider = ""
        if settings.kind == "dds" and settings.discovery_range == "LOCALHOST":
            wider = (
                ", and nodes on other machines, or of Cyclone DDS with its default range, need "
                "ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET here"
            )
        sys.stderr.write(
            f"no ROS 2 node was found on {place_of(transport)}. {_running_hint(settings)}Nodes of another "
            "domain need its ROS_DOMAIN_ID, nodes of the other middleware need --transport "
            f"{other}{wider}\n"
        )
    return shown


def _running_hint(settings: TransportSettings) -> str:
    """Describe what runs on this machine and why it is not in this graph; "" if nothing runs."""
    from joshua.tools import CallError, RunningSystem

    text = ""
    for system in RunningSystem.all():
        info = system.info
        with contextlib.suppress(CallError):
            mode = system.status().mode
            if mode == "MODE_CALIBRATION":
                text += f"{info.source} is being calibrated, which needs no ROS 2 nodes. "
            elif info.domain_id != settings.domain_id:
                text += f"{info.source} runs in domain {info.domain_id}: set ROS_DOMAIN_ID={info.domain_id}. "
            else:
                text += f"{info.source} runs: name it with --config. "
    return text


def place_of(transport: Transport) -> str:
    """Describe where a command looks: the meeting point and the domain."""
    if transport.settings.kind == "dds":
        return transport.meeting_point
    return f"{transport.meeting_point}, domain {transport.settings.domain_id}"


def full_topic(name: str) -> str:
    """Return a topic or node name with its leading slash."""
    return name if name.startswith("/") else f"/{name}"


def full_name(node: NodeInfo) -> str:
    """Return the fully qualified name of a node."""
    return f"{node.namespace.rstrip('/')}/{node.name}"


def find_topic(transport: Transport, topic: str, wait_s: float) -> list[EndpointInfo]:
    """Wait for a topic to appear. Returns its endpoints. Raises GraphError if it does not."""
    nodes = _wait_for("topic", topic, transport, wait_s)
    return [endpoint for node in nodes for endpoint in node.endpoints if endpoint.topic == topic]


def find_node(transport: Transport, name: str, wait_s: float) -> list[NodeInfo]:
    """Wait for a node to appear. Returns all of that name. Raises GraphError if it does not."""
    return [node for node in _wait_for("node", name, transport, wait_s) if full_name(node) == name]


def _wait_for(kind: str, name: str, transport: Transport, wait_s: float) -> list[NodeInfo]:
    """Wait for a topic or node. Returns the graph a moment later, when the rest of it is known.

    Raises:
        GraphError: it did not appear. The message names the nearest.
    """

    def names_of(nodes: Sequence[NodeInfo]) -> list[str]:
        topics = {end.topic for node in nodes for end in node.endpoints}
        return sorted(topics if kind == "topic" else map(full_name, nodes))

    names: list[str] = []
    for _ in looks(wait_s):
        nodes = transport.nodes()
        names = names_of(nodes)
        if name in names:
            settled = wait_for_graph(transport, min(wait_s, _SETTLE_S))
            return settled if name in names_of(settled) else nodes
    if near := difflib.get_close_matches(name, names, n=3, cutoff=0.4):
        hint = f"the nearest are {', '.join(near)}"
    elif names:
        hint = f"there are {', '.join(names[:8])}{', …' if len(names) > 8 else ''}"
    else:
        hint = f"there is none on {place_of(transport)}"
    raise GraphError(f"no {kind} {name} appeared within {wait_s:g} s; {hint}", ExitCode.INVALID)


def type_of(endpoints: Sequence[EndpointInfo]) -> str:
    """Return the type of a topic.

    Raises:
        GraphError: its endpoints do not agree.
    """
    names = sorted({endpoint.type_name for endpoint in endpoints})
    if len(names) > 1:
        raise GraphError(
            f"the endpoints of {endpoints[0].topic} have several types: {', '.join(names)}. Choose one with "
            "--type",
            ExitCode.INVALID,
        )
    return type_name(names[0])


def type_name(text: str) -> str:
    """Return the ROS 2 type of a ROS 2 name, or of a DataType such as ``JOINT_STATE``.

    Raises:
        MessageError: there is no such type. The message names the nearest.
    """
    from joshua.api.schema import data_types
    from joshua.messages import MessageError
    from joshua.messages.typestore import require_type

    if "/" in text or "::" in text:
        return require_type(text)
    try:
        return data_types.type_name(data_types.number(text.upper()))
    except ValueError:
        numbers = {data_types.number(name): name for name in data_types.type_names()}
        names = {enum: full for number, full in numbers.items() for enum in data_types.enum_names(number)}
        words = {**names, **{full.rsplit("/", 1)[1]: full for full in names.values()}}
        near = difflib.get_close_matches(text, words, n=3, cutoff=0.5)
        hint = f"; the nearest are {', '.join(dict.fromkeys(words[word] for word in near))}" if near else ""
        raise MessageError(
            f"{text!r} is not a message type; write package/msg/Type or a DataType such as JOINT_STATE{hint}"
        ) from None


def show(lines: Iterable[str]) -> None:
    """Print lines, wrapped between values on a terminal."""
    from joshua.tools import Screen

    screen = Screen.of(sys.stdout)
    for line in lines:
        if len(line) > _LONGEST_WRAPPED:
            sys.stdout.write(f"{line}\n")
            continue
        depth = len(line) - len(line.lstrip())
        sys.stdout.writelines(f"{piece}\n" for piece in screen.wrap(line, indent=depth + 4))


def endpoint_lines(endpoints: Sequence[EndpointInfo], *, of_node: bool) -> list[str]:
    """Format the endpoints of a topic or node, publishers first, each with its quality of service."""
    lines = []
    for label, is_publisher in (("publishers", True), ("subscriptions", False)):
        chosen = [endpoint for endpoint in endpoints if endpoint.is_publisher is is_publisher]
        lines.append(f"{label}: {len(chosen)}")
        for end in sorted(chosen, key=lambda end: end.topic) if of_node else chosen:
            node = f"{end.node_namespace.rstrip('/')}/{end.node_name}"
            name = f"{end.topic}  {end.type_name}" if of_node else node
            lines.append(f"  {name}  {qos_text(end.qos)}")
    return lines


def qos_text(qos: QosProfile) -> str:
    """Format a profile in one line; durations only if they are set."""
    depth = f" {qos.depth}" if qos.history == "KEEP_LAST" else ""
    parts = [qos.reliability, qos.durability, f"{qos.history}{depth}"]
    if qos.liveliness != "AUTOMATIC":
        parts.append(qos.liveliness)
    durations = (("deadline", qos.deadline_s), ("lifespan", qos.lifespan_s), ("lease", qos.lease_duration_s))
    return ", ".join(parts + [f"{label} {duration_s:g} s" for label, duration_s in durations if duration_s])


def profile_for(publishers: Sequence[EndpointInfo], depth: int) -> QosProfile:
    """Return a profile compatible with all publishers, which receives kept messages if all keep some."""
    from joshua.api.transports import QosProfile

    offers = [endpoint.qos for endpoint in publishers if endpoint.is_publisher]
    best_effort = any(offer.reliability == "BEST_EFFORT" for offer in offers)
    kept = bool(offers) and all(offer.durability == "TRANSIENT_LOCAL" for offer in offers)
    return QosProfile(
        reliability="BEST_EFFORT" if best_effort else "RELIABLE",
        durability="TRANSIENT_LOCAL" if kept else "VOLATILE",
        depth=depth,
    )

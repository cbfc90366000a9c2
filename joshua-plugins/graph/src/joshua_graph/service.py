"""``joshua service``: list and call the services of any running ROS 2 graph."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING

from joshua.tools import ExitCode, GraphError, positive_seconds

from joshua_graph.graph import (
    add_graph_options,
    full_topic,
    graph_session,
    looks,
    run_graph_command,
    show,
)
from joshua_graph.topic import read_values

if TYPE_CHECKING:
    import argparse

    from joshua.api.transports import ServiceInfo, Transport

SUMMARY = "list and call the services of a running graph"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the subcommands."""
    actions = parser.add_subparsers(dest="service_action", metavar="ACTION", required=True, title="actions")
    listing = actions.add_parser("list", help="list the services", description="list the services")
    listing.add_argument("-t", "--types", action="store_true", help="show the type of each service too")
    listing.set_defaults(graph_command=_list)
    shown = actions.add_parser("type", help="show the type of a service", description="show its type")
    calling = actions.add_parser("call", help="call a service", description="call a service")
    for action in (shown, calling):
        action.add_argument("service", metavar="SERVICE", help="service name, such as /arm/stop")
    shown.set_defaults(graph_command=_type)
    calling.add_argument(
        "values", metavar="VALUES", nargs="?", default="{}", help="request as YAML or JSON (default: empty)"
    )
    calling.add_argument(
        "--timeout",
        metavar="SECONDS",
        type=positive_seconds,
        default=10.0,
        help="how long to wait for the response (default 10)",
    )
    calling.set_defaults(graph_command=_call)
    for action in (listing, shown, calling):
        add_graph_options(action)


run = run_graph_command


def _list(arguments: argparse.Namespace) -> int:
    with graph_session(arguments) as transport:
        for item in _services(transport, arguments.wait):
            show([f"{item.name} [{item.type_name}]" if arguments.types else item.name])
    return ExitCode.OK


def _type(arguments: argparse.Namespace) -> int:
    with graph_session(arguments) as transport:
        sys.stdout.write(f"{_find(transport, arguments).type_name}\n")
    return ExitCode.OK


def _call(arguments: argparse.Namespace) -> int:
    """Call a service and print its response; return 1 if a std_srvs response reports a failure."""
    from joshua.messages import decode, encode
    from joshua.messages.fields import build
    from joshua.messages.text import message_text

    values = read_values(arguments.values)
    with graph_session(arguments) as transport:
        service = _find(transport, arguments)
        request = bytes(encode(build(f"{service.type_name}_Request", values)))
        node = transport.create_node(f"_joshua_{os.getpid()}")
        answer = node.call_service(service.name, service.type_name, request, arguments.timeout)
    response = decode(f"{service.type_name}_Response", answer)
    show(message_text(response, full=True).splitlines())
    return ExitCode.OK if getattr(response, "success", True) else ExitCode.FAILED


def _find(transport: Transport, arguments: argparse.Namespace) -> ServiceInfo:
    import difflib  # imported here, because only an error needs it

    name = full_topic(arguments.service)
    known: list[ServiceInfo] = []
    for _ in looks(arguments.wait):
        known = transport.services()
        for item in known:
            if item.name == name:
                return item
    near = difflib.get_close_matches(name, [item.name for item in known], n=1, cutoff=0.5)
    hint = f" Did you mean {near[0]}?" if near else " `joshua service list` shows the services."
    _require_services(transport)
    raise GraphError(f"no node offers the service {name}.{hint}", ExitCode.INVALID)


def _services(transport: Transport, wait_s: float) -> list[ServiceInfo]:
    """Return the services, once nothing new has appeared for a moment."""
    _require_services(transport)
    known: list[ServiceInfo] = []
    quiet = 0
    for _ in looks(wait_s):
        before, known = known, transport.services()
        quiet = quiet + 1 if known == before else 0
        if known and quiet > 15:
            break
    return known


def _require_services(transport: Transport) -> None:
    if not transport.carries_services:
        kind = transport.settings.kind
        raise GraphError(f"the transport {kind} carries no services. Use --transport zenoh or `joshua call`")

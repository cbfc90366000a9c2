"""Nodes of several machines need a transport that leaves loopback."""

from __future__ import annotations

from collections.abc import Iterator

from joshua.config.checks.context import Context
from joshua.config.checks.endpoint_text import parse_endpoint
from joshua.config.checks.identity import title
from joshua.plan import Diagnostic


def check(context: Context) -> Iterator[Diagnostic]:
    """Finds nodes on several machines whose transport does not leave loopback."""
    transport = context.config.transport
    first: dict[str, str] = {}
    for entry in context.graph.entries:
        if entry.node.host:
            first.setdefault(entry.node.host, entry.path)
    if len(first) < 2:
        return
    reachable = (
        transport.network_interface
        or transport.peers
        or any(not parse_endpoint(text).is_loopback for text in transport.listen_endpoints)
        or any(not parse_endpoint(text).is_loopback for text in transport.connect_endpoints)
    )
    if reachable:
        return
    names = list(first)
    path = f"{first[names[1]]}.host"
    entry = next(item for item in context.graph.entries if item.path == first[names[1]])
    yield context.warning(
        "hosts-apart",
        f"{title(entry)} runs on {names[1]} and other nodes run on {names[0]}, but the transport stays on "
        "loopback, so they do not meet",
        path,
        found=", ".join(names),
        related=context.see(f"{first[names[0]]}.host", f"first machine, {names[0]}"),
    )

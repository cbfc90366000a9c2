"""ROS 2 topics over Zenoh or DDS behind one interface."""

from __future__ import annotations

from joshua.plan import TransportSpec
from joshua.transport.api import (
    EndpointInfo,
    NodeHandle,
    NodeInfo,
    Publisher,
    Sample,
    Subscription,
    Transport,
)
from joshua.transport.errors import TransportError, TransportMissingError

__all__ = [
    "EndpointInfo",
    "NodeHandle",
    "NodeInfo",
    "Publisher",
    "Sample",
    "Subscription",
    "Transport",
    "TransportError",
    "TransportMissingError",
    "TransportSpec",
    "open_transport",
]


def open_transport(spec: TransportSpec) -> Transport:
    """Connects this process to the ROS 2 graph.

    Open it once in a process and never before a fork: a child that inherits an open Zenoh session
    hangs when it opens one of its own. Type hashes and message classes follow ``spec.distro`` from
    here on.

    Raises:
        TransportError: the middleware refuses the settings.
        TransportMissingError: DDS was chosen without the extra ``joshua-core[dds]``.
    """
    from joshua.messages import select_distro
    from joshua.transport.memory import keep_freed_memory
    from joshua.transport.preconditions import require_usable

    require_usable(spec)
    select_distro(spec.distro)
    keep_freed_memory()
    if spec.kind == "dds":
        from joshua.transport.dds import open_dds

        return open_dds(spec)
    from joshua.transport.zenoh.transport import ZenohTransport

    return ZenohTransport(spec)

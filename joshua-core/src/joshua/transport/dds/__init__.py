"""ROS 2 topics over DDS, by the conventions of rmw_cyclonedds and rmw_fastrtps."""

from __future__ import annotations

from joshua.plan import TransportSpec
from joshua.transport.api import Transport
from joshua.transport.errors import TransportMissingError


def open_dds(spec: TransportSpec) -> Transport:
    """Joins the DDS domain.

    Raises:
        TransportMissingError: the extra is not installed.
    """
    raise TransportMissingError("DDS needs the extra joshua-core[dds]: pip install 'joshua-core[dds]'")

"""ROS 2 topics over DDS, by the conventions of rmw_cyclonedds and rmw_fastrtps."""

from __future__ import annotations

from joshua.plan import TransportSpec
from joshua.transport.api import Transport
from joshua.transport.choose import dds_installed
from joshua.transport.errors import TransportMissingError


def open_dds(spec: TransportSpec) -> Transport:
    """Joins the DDS domain.

    Raises:
        TransportMissingError: the extra is not installed.
        TransportError: DDS refuses the settings.
    """
    if not dds_installed():
        raise TransportMissingError(
            "the transport is DDS, which needs the extra joshua-core[dds]: pip install 'joshua-core[dds]'; "
            "or set kind: TRANSPORT_ZENOH in the file's transport block"
        )
    from joshua.transport.dds.transport import DdsTransport

    return DdsTransport(spec)

"""Everything that a node offers to ROS 2 beside its topics."""

from __future__ import annotations

from joshua.api.nodes import ExtendedNode

from joshua_services.lifecycle import offer_lifecycle
from joshua_services.parameters import Parameters
from joshua_services.verbs import offer_verbs


def offer(node: ExtendedNode) -> None:
    """Declare the services of a node."""
    offer_verbs(node)
    Parameters(node).offer()
    offer_lifecycle(node)

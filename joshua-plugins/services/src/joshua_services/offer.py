"""ROS 2 interfaces of a node beside its topics."""

from __future__ import annotations

from joshua.api.nodes import ExtendedNode

from joshua_services.lifecycle import offer_lifecycle
from joshua_services.parameters import Parameters
from joshua_services.trajectory import TrajectoryServer, trajectory_topic
from joshua_services.verbs import offer_verbs


def offer(node: ExtendedNode) -> None:
    """Declare the services of a node, and the action of an actuator that takes trajectories from outside."""
    offer_verbs(node)
    Parameters(node).offer()
    offer_lifecycle(node)
    if topic := trajectory_topic(node):
        TrajectoryServer(node, topic)

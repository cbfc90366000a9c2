"""Lifecycle of a node, as of ROS 2's managed nodes.

A node of a run is active, or inactive after a fault. The run configures and stops its nodes itself.
Activating one that has a fault is its verb ``resume``, which enables torque: it is refused to the network.
"""

from __future__ import annotations

from functools import partial
from typing import Any

from joshua.api.nodes import ExtendedNode
from joshua.messages import message_class

from joshua_services.serving import serve

# lifecycle_msgs/msg/State and Transition
INACTIVE, ACTIVE = (2, "inactive"), (3, "active")
ACTIVATE = (3, "activate")
_PACKAGE = "lifecycle_msgs/srv/"


def offer_lifecycle(node: ExtendedNode) -> None:
    """Declare the lifecycle services of a node."""
    serve(node, "get_state", f"{_PACKAGE}GetState", lambda _: {"current_state": _state(present(node))})
    serve(
        node,
        "get_available_states",
        f"{_PACKAGE}GetAvailableStates",
        lambda _: {"available_states": [_state(INACTIVE), _state(ACTIVE)]},
    )
    serve(
        node,
        "get_available_transitions",
        f"{_PACKAGE}GetAvailableTransitions",
        lambda _: {"available_transitions": _transitions(node)},
    )
    serve(node, "change_state", f"{_PACKAGE}ChangeState", partial(_change, node))


def present(node: ExtendedNode) -> tuple[int, str]:
    """Return the state of a node by number and label."""
    return INACTIVE if node.context.fault_reason else ACTIVE


def _state(state: tuple[int, str]) -> Any:
    number, label = state
    return message_class("lifecycle_msgs/msg/State")(id=number, label=label)


def _transitions(node: ExtendedNode) -> list[Any]:
    if present(node) == ACTIVE or "resume" not in {verb.name for verb in node.verbs}:
        return []
    number, label = ACTIVATE
    transition = message_class("lifecycle_msgs/msg/Transition")(id=number, label=label)
    make = message_class("lifecycle_msgs/msg/TransitionDescription")
    return [make(transition=transition, start_state=_state(INACTIVE), goal_state=_state(ACTIVE))]


def _change(node: ExtendedNode, request: Any) -> dict[str, Any]:
    """Handle a request for a transition; the reason is logged, because the response has no field for it."""
    number, label = int(request.transition.id), str(request.transition.label)
    if not _transitions(node) or (number, label) not in (ACTIVATE, (ACTIVATE[0], ""), (0, ACTIVATE[1])):
        node.context.log.warning(
            "a ROS 2 node asked for the transition %s, but the node is %s: refused. The run starts and stops "
            "its nodes",
            label or number,
            present(node)[1],
        )
        return {"success": False}
    reply = node.ask("resume", {})
    if not reply.ok:
        node.context.log.warning("a ROS 2 node asked for the transition activate, refused: %s", reply.text)
    return {"success": reply.ok}

"""Extensions that plugins add to a node in the graph."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from joshua.ipc.messages import CallReply
from joshua.node.context import NodeContext
from joshua.node.verbs import Verb
from joshua.plugins.targets import load_target
from joshua.transport import NodeHandle, Publisher


@dataclass(frozen=True)
class ExtendedNode:
    """A node, as passed to an extension.

    Attributes:
        context: of the node: its plan, log and threads; handle: the node in the graph.
        verbs: verbs that it offers.
        ask: calls a verb by name and payload for a caller in the network, and waits for the reply.
        parameter_events: its publisher on ``/parameter_events``.
    """

    context: NodeContext
    handle: NodeHandle
    verbs: tuple[Verb, ...]
    ask: Callable[[str, dict[str, Any]], CallReply]
    parameter_events: Publisher


def extend(node: ExtendedNode) -> None:
    """Add the extensions of plugins to the node. One that fails does not affect the others or the node."""
    for target in node.context.spec.extensions:
        try:
            load_target(target)(node)
        except Exception as error:  # noqa: BLE001 - code of a plugin
            name = node.context.spec.full_name
            node.context.warn(f"{name}: {target} failed: {type(error).__name__}: {error}")

"""Services as functions from the fields of a request to those of a response."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from joshua.api.nodes import ExtendedNode
from joshua.messages import decode, encode, message_class

Answer = Callable[[Any], dict[str, Any]]


def serve(node: ExtendedNode, name: str, kind: str, answer: Answer) -> None:
    """Offer a service.

    Args:
        name: below the name of the node, such as ``get_state``.
        kind: its type; answer: maps the request to the fields of the response.
    """

    def respond(request: bytes) -> bytes:
        values = answer(decode(f"{kind}_Request", request))
        return bytes(encode(message_class(f"{kind}_Response")(**values)))

    node.handle.create_service(f"{node.context.spec.full_name}/{name}", kind, respond)

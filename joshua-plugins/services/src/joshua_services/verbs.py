"""Verbs as services: the types of std_srvs where one fits, else the parameters of rcl_interfaces.

The caller of a service is not the local user: verbs that enable torque or move a joint are refused, with the
reason in the response.
"""

from __future__ import annotations

import json
from functools import partial
from typing import Any

from joshua.api.nodes import ExtendedNode, Verb

from joshua_services.serving import serve
from joshua_services.values import nested, value_of

TRIGGER = "std_srvs/srv/Trigger"
SET_BOOL = "std_srvs/srv/SetBool"
#: Part of every ROS 2 installation; it carries named values of every type.
NAMED_VALUES = "rcl_interfaces/srv/SetParametersAtomically"


def offer_verbs(node: ExtendedNode) -> None:
    """Declare a service for each verb of a node."""
    for verb in node.verbs:
        field = boolean_field(verb)
        if verb.request is None:
            serve(node, verb.name, TRIGGER, partial(_trigger, node, verb))
        elif field:
            serve(node, verb.name, SET_BOOL, partial(_set_bool, node, verb, field))
        else:
            serve(node, verb.name, NAMED_VALUES, partial(_named_values, node, verb))


def boolean_field(verb: Verb) -> str:
    """Return the name of the only field of a request if it is a boolean; else ""."""
    fields = verb.info().request.get("properties", {})
    name = next(iter(fields), "")
    return name if len(fields) == 1 and fields[name].get("type") == "boolean" else ""


def _call(node: ExtendedNode, verb: Verb, payload: dict[str, Any]) -> tuple[bool, str]:
    reply = node.ask(verb.name, payload)
    said = reply.payload.get("text", json.dumps(reply.payload) if reply.payload else "")
    return reply.ok, str(said if reply.ok else reply.text)


def _trigger(node: ExtendedNode, verb: Verb, request: Any) -> dict[str, Any]:
    done, text = _call(node, verb, {})
    return {"success": done, "message": text}


def _set_bool(node: ExtendedNode, verb: Verb, field: str, request: Any) -> dict[str, Any]:
    done, text = _call(node, verb, {field: bool(request.data)})
    return {"success": done, "message": text}


def _named_values(node: ExtendedNode, verb: Verb, request: Any) -> dict[str, Any]:
    from joshua.messages import message_class

    payload = nested({item.name: value_of(item.value) for item in request.parameters})
    done, text = _call(node, verb, payload)
    result = message_class("rcl_interfaces/msg/SetParametersResult")(successful=done, reason=text)
    return {"result": result}

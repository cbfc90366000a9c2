"""Verbs and parameters of a node as ROS 2 services, where the transport carries services.

A verb without a request is a ``std_srvs/srv/Trigger``, one that takes a single boolean a
``std_srvs/srv/SetBool``; other verbs have no type in ROS 2 and stay with ``joshua call``. Whoever calls a
service is not the local user: what gives torque or moves a joint is refused, with the reason in the
response.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any

from joshua.ipc.messages import CallReply
from joshua.messages import decode, encode, message_class
from joshua.node.verbs import Verb
from joshua.plan import NodeSpec
from joshua.transport import NodeHandle

Ask = Callable[[str, dict[str, Any]], CallReply]

_VALUE = "rcl_interfaces/msg/ParameterValue"
_FIXED = "the parameter is set in the configuration file: change it there and restart the run"
# rcl_interfaces/msg/ParameterType, with the field of a ParameterValue; bool before int, which it is one of
_TYPES: tuple[tuple[type, int, str], ...] = (
    (bool, 1, "bool_value"),
    (int, 2, "integer_value"),
    (float, 3, "double_value"),
    (str, 4, "string_value"),
)
_ARRAY_TYPES = {1: (6, "bool_array_value"), 2: (7, "integer_array_value"), 3: (8, "double_array_value")}
_ARRAY_TYPES[4] = (9, "string_array_value")


def offer_services(handle: NodeHandle, spec: NodeSpec, verbs: Iterable[Verb], ask: Ask) -> None:
    """Declare the services of a node.

    Args:
        handle: the node in the graph; spec: its part of the plan.
        verbs: what it can be asked for; ask: calls a verb by name and payload, and waits for the reply.
    """
    for verb in verbs:
        field = _boolean_field(verb)
        if verb.request is None:
            kind, read = "std_srvs/srv/Trigger", _nothing
        elif field:
            kind, read = "std_srvs/srv/SetBool", partial(_boolean, field)
        else:
            continue
        serve = partial(_serve_verb, kind, verb.name, read, ask)
        handle.create_service(f"{spec.full_name}/{verb.name}", kind, serve)
    values = {"use_sim_time": spec.facts.use_sim_time, **_flat(spec.settings)}
    for name, answer in (
        ("list_parameters", _list),
        ("get_parameters", _get),
        ("get_parameter_types", _types),
        ("describe_parameters", _describe),
        ("set_parameters", _set),
        ("set_parameters_atomically", _set_atomically),
    ):
        kind = "rcl_interfaces/srv/" + "".join(part.capitalize() for part in name.split("_"))
        handle.create_service(
            f"{spec.full_name}/{name}", kind, partial(_serve, kind, partial(answer, values))
        )


def _serve(kind: str, answer: Callable[[Any], dict[str, Any]], request: bytes) -> bytes:
    values = answer(decode(f"{kind}_Request", request))
    return bytes(encode(message_class(f"{kind}_Response")(**values)))


def _serve_verb(
    kind: str, name: str, read: Callable[[Any], dict[str, Any]], ask: Ask, request: bytes
) -> bytes:
    reply = ask(name, read(decode(f"{kind}_Request", request)))
    done = reply.payload.get("text", json.dumps(reply.payload) if reply.payload else "")
    return bytes(
        encode(
            message_class(f"{kind}_Response")(success=reply.ok, message=str(done if reply.ok else reply.text))
        )
    )


def _nothing(request: Any) -> dict[str, Any]:
    return {}


def _boolean(field: str, request: Any) -> dict[str, Any]:
    return {field: bool(request.data)}


def _boolean_field(verb: Verb) -> str:
    """Name of the only field of a request, if it is a boolean; else ""."""
    fields = verb.info().request.get("properties", {})
    name = next(iter(fields), "")
    return name if len(fields) == 1 and fields[name].get("type") == "boolean" else ""


def _flat(settings: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Settings as parameters: names with dots, values that ROS 2 has a type for."""
    found: dict[str, Any] = {}
    for key, value in settings.items():
        if isinstance(value, Mapping):
            found |= _flat(value, f"{prefix}{key}.")
        elif _type_of(value)[0]:
            found[f"{prefix}{key}"] = value
    return found


def _type_of(value: Any) -> tuple[int, str]:
    """ParameterType and field of a value; 0 for one that parameters cannot hold."""
    for kind, number, field in _TYPES:
        if isinstance(value, kind):
            return number, field
    if isinstance(value, (list, tuple)) and value:
        numbers = {_type_of(item)[0] for item in value}
        if numbers == {2, 3}:
            numbers = {3}
        return _ARRAY_TYPES.get(numbers.pop(), (0, "")) if len(numbers) == 1 else (0, "")
    return 0, ""


def _value(values: Mapping[str, Any], name: str) -> Any:
    value = values.get(name)
    number, field = _type_of(value)
    return message_class(_VALUE)(**({"type": number, field: value} if number else {}))


def _list(values: Mapping[str, Any], request: Any) -> dict[str, Any]:
    prefixes = tuple(f"{prefix}." for prefix in request.prefixes)
    names = [name for name in values if not prefixes or name.startswith(prefixes) or name in request.prefixes]
    groups = sorted({name.rpartition(".")[0] for name in names if "." in name})
    result = message_class("rcl_interfaces/msg/ListParametersResult")(names=names, prefixes=groups)
    return {"result": result}


def _get(values: Mapping[str, Any], request: Any) -> dict[str, Any]:
    return {"values": [_value(values, name) for name in request.names]}


def _types(values: Mapping[str, Any], request: Any) -> dict[str, Any]:
    return {"types": [_type_of(values.get(name))[0] for name in request.names]}


def _describe(values: Mapping[str, Any], request: Any) -> dict[str, Any]:
    make = message_class("rcl_interfaces/msg/ParameterDescriptor")
    return {
        "descriptors": [
            make(name=name, type=_type_of(values.get(name))[0], read_only=True) for name in request.names
        ]
    }


def _set(values: Mapping[str, Any], request: Any) -> dict[str, Any]:
    make = message_class("rcl_interfaces/msg/SetParametersResult")
    return {
        "results": [
            make(successful=False, reason=_FIXED if item.name in values else f"no parameter {item.name!r}")
            for item in request.parameters
        ]
    }


def _set_atomically(values: Mapping[str, Any], request: Any) -> dict[str, Any]:
    return {"result": _set(values, request)["results"][0]} if request.parameters else {}

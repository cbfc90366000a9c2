"""Parameters of a node: its settings, and values that its verbs can change at run time."""

from __future__ import annotations

import time
from types import MethodType
from typing import Any, cast

from joshua.api.nodes import ExtendedNode, Verb
from joshua.messages import encode, message_class

from joshua_services.serving import serve
from joshua_services.values import flat, parameter_value, type_of, value_of

_FIXED = "the parameter is set in the configuration file: change it there and restart the run"
_PARAMETER = "rcl_interfaces/msg/Parameter"


class Parameters:
    """The parameter services of one node, and its events on ``/parameter_events``.

    A verb that declares ``sets`` makes a parameter writable. Setting it calls that verb on behalf of a
    caller in the network, with all its checks.
    """

    def __init__(self, node: ExtendedNode) -> None:
        self._node = node
        spec = node.context.spec
        self._fixed = {"use_sim_time": spec.facts.use_sim_time, **flat(spec.settings)}
        self._verbs = {verb.sets: verb for verb in node.verbs if verb.sets}

    def offer(self) -> None:
        """Declare the services, and publish the parameters to ROS 2."""
        for name, answer in (
            ("list_parameters", self._list),
            ("get_parameters", self._get),
            ("get_parameter_types", self._types),
            ("describe_parameters", self._describe),
            ("set_parameters", self._set),
            ("set_parameters_atomically", self._set_atomically),
        ):
            kind = "rcl_interfaces/srv/" + "".join(part.capitalize() for part in name.split("_"))
            serve(self._node, name, kind, answer)
        self._publish("new_parameters", list(self.values()))

    def values(self) -> dict[str, Any]:
        """Return the parameters and their present values."""
        return self._fixed | {name: _present(verb) for name, verb in self._verbs.items()}

    def set(self, name: str, value: Any) -> tuple[bool, str]:
        """Change a parameter; return whether it worked, and the reason or result."""
        verb = self._verbs.get(name)
        if verb is None:
            return False, _FIXED if name in self._fixed else f"no parameter {name!r}"
        before = _present(verb)
        if isinstance(before, float) and type(value) is int:
            value = float(value)
        if type_of(value)[0] != type_of(before)[0]:
            return False, f"{name} is of type {type(before).__name__}"
        (field,) = verb.info().request["properties"]
        reply = self._node.ask(verb.name, {field: value})
        if reply.ok:
            self._publish("changed_parameters", [name])
        return reply.ok, str(reply.payload.get("text", "") if reply.ok else reply.text)

    def _publish(self, field: str, names: list[str]) -> None:
        values, make = self.values(), message_class(_PARAMETER)
        seconds, nanoseconds = divmod(time.time_ns(), 1_000_000_000)
        event = message_class("rcl_interfaces/msg/ParameterEvent")(
            stamp=message_class("builtin_interfaces/msg/Time")(sec=seconds, nanosec=nanoseconds),
            node=self._node.context.spec.full_name,
            **{field: [make(name=name, value=parameter_value(values[name])) for name in names]},
        )
        self._node.parameter_events.publish(encode(event))

    def _list(self, request: Any) -> dict[str, Any]:
        prefixes = tuple(f"{prefix}." for prefix in request.prefixes)
        names = [
            name
            for name in self.values()
            if not prefixes or name.startswith(prefixes) or name in request.prefixes
        ]
        groups = sorted({name.rpartition(".")[0] for name in names if "." in name})
        result = message_class("rcl_interfaces/msg/ListParametersResult")(names=names, prefixes=groups)
        return {"result": result}

    def _get(self, request: Any) -> dict[str, Any]:
        values = self.values()
        return {"values": [parameter_value(values.get(name)) for name in request.names]}

    def _types(self, request: Any) -> dict[str, Any]:
        values = self.values()
        return {"types": [type_of(values.get(name))[0] for name in request.names]}

    def _describe(self, request: Any) -> dict[str, Any]:
        make, values = message_class("rcl_interfaces/msg/ParameterDescriptor"), self.values()
        return {
            "descriptors": [
                make(
                    name=name,
                    type=type_of(values.get(name))[0],
                    read_only=name not in self._verbs or self._verbs[name].moves,
                    description=self._verbs[name].summary if name in self._verbs else "",
                )
                for name in request.names
            ]
        }

    def _set(self, request: Any) -> dict[str, Any]:
        make = message_class("rcl_interfaces/msg/SetParametersResult")
        results = [self.set(item.name, value_of(item.value)) for item in request.parameters]
        return {"results": [make(successful=done, reason=reason) for done, reason in results]}

    def _set_atomically(self, request: Any) -> dict[str, Any]:
        make = message_class("rcl_interfaces/msg/SetParametersResult")
        if len(request.parameters) > 1:
            reason = "parameters are set one at a time: use set_parameters"
            return {"result": make(successful=False, reason=reason)}
        done, reason = True, ""
        for item in request.parameters:
            done, reason = self.set(item.name, value_of(item.value))
        return {"result": make(successful=done, reason=reason)}


def _present(verb: Verb) -> Any:
    return getattr(cast(MethodType, verb.handler).__self__, f"{verb.sets}_parameter")

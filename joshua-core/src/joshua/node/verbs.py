"""Verbs: requests that a node accepts from outside, each declared at its method."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cached_property
from typing import Any, Literal, TypeVar, get_type_hints

from pydantic import TypeAdapter, ValidationError
from pydantic_core import PydanticSerializationError

from joshua.ipc.messages import VerbInfo
from joshua.node.errors import NodeError

#: The thread that runs a verb: ``loop`` is the node's own, between two timers; ``activation`` the same, with
#: the time of an activation, in which the node may be silent; ``beside`` one of its own, while timers
#: continue.
Runs = Literal["loop", "activation", "beside"]

#: Switching torque off is allowed for every caller.
ALWAYS_OPEN = frozenset({"stop", "estop"})

_MARK = "__joshua_verb__"
_METHOD = TypeVar("_METHOD", bound=Callable[..., Any])


@dataclass(frozen=True)
class Caller:
    """Origin of a call: ``local`` is the user who runs the robot, at the control socket of the run."""

    kind: Literal["local", "network"] = "local"
    name: str = ""


LOCAL = Caller()


@dataclass(frozen=True)
class Verb:
    """An action that a node performs on request.

    Attributes:
        name: of the verb; summary: one line of help.
        request: dataclass or pydantic model of the request; None for none.
        reply: dataclass or pydantic model of the reply; ``str`` for one sentence, None for none.
        moves: whether it enables torque or may move a joint. Then only the local user may call it.
        runs: the thread that runs it.
        handler: bound method that implements it.
        sets: name of the parameter that the only field of its request sets; "" for none. The value of the
            parameter is the provider's attribute ``<name>_parameter``.
    """

    name: str
    summary: str
    request: Any
    reply: Any
    moves: bool
    runs: Runs
    handler: Callable[..., Any]
    sets: str = ""

    def info(self) -> VerbInfo:
        """The description of the verb for people and programs outside the node."""
        return VerbInfo(
            name=self.name,
            summary=self.summary,
            moves=self.moves,
            request=_schema(self._request),
            reply=_schema(self._reply),
        )

    def bind(self, payload: Mapping[str, Any]) -> Callable[[], dict[str, Any]]:
        """Checks a request, and returns the action that executes the call.

        Raises:
            InvalidRequestError: it does not match ``request``. The message names every field.
        """
        unknown = [name for name in payload if name not in _fields(self._request)]
        problems = [self._unknown(name) for name in unknown]
        known = {name: value for name, value in payload.items() if name not in unknown}
        value = None
        if self._request is not None:
            try:
                value = self._request.validate_python(known)
                taken = self._request.dump_python(value)
                problems += [f"{key}: a number is not finite" for key in taken if not _finite(taken[key])]
            except ValidationError as error:
                problems += [
                    f"{'.'.join(map(str, item['loc'])) or 'request'}: {item['msg']}"
                    for item in error.errors(include_url=False, include_input=False)
                ]
        if problems:
            raise InvalidRequestError(f"{self.name}: {'; '.join(problems)}")

        def serve() -> dict[str, Any]:
            return self._dump(self.handler() if self._request is None else self.handler(value))

        return serve

    @cached_property
    def _request(self) -> TypeAdapter[Any] | None:
        return None if self.request is None else TypeAdapter(self.request)

    @cached_property
    def _reply(self) -> TypeAdapter[Any] | None:
        return None if self.reply in (None, type(None), str) else TypeAdapter(self.reply)

    def _unknown(self, name: str) -> str:
        fields = _fields(self._request)
        near = get_close_matches(name, fields, n=1)
        hint = f"; did you mean {near[0]}?" if near else ""
        return f"{name}: no such field{hint} ({', '.join(fields) or 'it takes none'})"

    def _dump(self, value: Any) -> dict[str, Any]:
        if self.reply is str:
            return {"text": str(value)}
        if self._reply is None:
            return {}
        try:
            dumped = self._reply.dump_python(self._reply.validate_python(value), mode="json")
        except (ValidationError, PydanticSerializationError) as error:
            raise TypeError(f"the verb {self.name} returned {value!r}, but declares {self.reply}") from error
        return dict(dumped)


class RefusedError(NodeError):
    """A verb is refused. The message says why and what to do. The node continues unchanged."""


class InvalidRequestError(Exception):
    """A request does not match the verb. The message names every field."""


class VerbDeclarationError(TypeError):
    """The declaration of a verb is invalid."""


def verb(*, moves: bool, runs: Runs = "loop", name: str = "", sets: str = "") -> Callable[[_METHOD], _METHOD]:
    """Declares a method as a verb of its node.

    The method takes nothing or one request, and returns nothing, a sentence or a reply. Request and reply are
    dataclasses or pydantic models, named by the method's annotations. The first line of its docstring is the
    help. It raises RefusedError to refuse. Any other exception fails the node if the verb moves.

    Args:
        moves: whether it enables torque or may move a joint. Only the local user may call such a verb.
        runs: the thread that runs it. ``loop`` must return within the time limit of a timer's callback.
        name: of the verb; "" for the method's name.
        sets: name of the parameter that its only field sets, while the provider has ``<name>_parameter``.
    """

    def declare(method: _METHOD) -> _METHOD:
        setattr(method, _MARK, (name or method.__name__, moves, runs, sets))
        return method

    return declare


def verbs_of(providers: Iterable[object]) -> dict[str, Verb]:
    """The verbs of a node's behaviour and driver, by name. Of two with the same name, the first counts.

    Raises:
        VerbDeclarationError: a method cannot be a verb.
    """
    found: dict[str, Verb] = {}
    for provider in providers:
        for attribute in dir(type(provider)):
            owners = [vars(base).get(attribute) for base in type(provider).__mro__]
            mark = next((getattr(owner, _MARK) for owner in owners if hasattr(owner, _MARK)), None)
            if mark is not None:
                found.setdefault(mark[0], _made(provider, attribute, *mark))
    return dict(sorted(found.items()))


def allowed(verb: Verb, caller: Caller) -> str:
    """Why a caller may not call a verb; "" if it may. Every entry point of a node checks this."""
    if caller.kind == "local" or not verb.moves or verb.name in ALWAYS_OPEN:
        return ""
    return f"{verb.name} enables torque or moves a joint: only the user who runs the robot may call it there"


def _made(provider: object, attribute: str, name: str, moves: bool, runs: Runs, sets: str) -> Verb:
    method = getattr(provider, attribute)
    where = f"{type(provider).__name__}.{attribute}"
    try:
        hints = get_type_hints(method, include_extras=True)
    except NameError as error:
        raise VerbDeclarationError(f"{where}: {error}: import it outside TYPE_CHECKING") from error
    parameters = list(inspect.signature(method).parameters)
    if len(parameters) > 1 or not set(parameters) <= set(hints) or "return" not in hints:
        raise VerbDeclarationError(f"{where}: a verb takes one request at most; annotate it and the return")
    made = Verb(
        name=name,
        summary=(inspect.getdoc(method) or "").partition("\n")[0],
        request=hints[parameters[0]] if parameters else None,
        reply=hints["return"],
        moves=moves,
        runs=runs,
        handler=method,
        sets=sets,
    )
    if parameters and _schema(made._request).get("type") != "object":
        raise VerbDeclarationError(f"{where}: its request must be a dataclass or a pydantic model")
    if made._reply is not None and _schema(made._reply).get("type") != "object":
        raise VerbDeclarationError(f"{where}: it must return a dataclass, a pydantic model, str or None")
    return made


def _schema(adapter: TypeAdapter[Any] | None) -> dict[str, Any]:
    return {} if adapter is None else adapter.json_schema()


def _fields(adapter: TypeAdapter[Any] | None) -> list[str]:
    return list(_schema(adapter).get("properties", {}))


def _finite(value: Any) -> bool:
    if isinstance(value, Mapping):
        return all(map(_finite, value.values()))
    if isinstance(value, (list, tuple)):
        return all(map(_finite, value))
    return not isinstance(value, float) or math.isfinite(value)

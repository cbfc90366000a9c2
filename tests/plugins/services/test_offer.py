"""What a node answers to callers in the network: parameters, verbs with a request, and its lifecycle."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest
from joshua.ipc.messages import CallReply
from joshua.messages import decode, encode
from joshua.messages.fields import build
from joshua.node.extensions import ExtendedNode
from joshua.node.verbs import InvalidRequestError, RefusedError, verb, verbs_of
from joshua.plan import NodeKind, NodeSpec
from joshua.testing.recording_context import RecordingContext
from joshua_services.offer import offer

CHANGE = {"transition": {"id": 3, "label": "activate"}}


@dataclass(frozen=True)
class Text:
    text: str


@dataclass(frozen=True)
class Where:
    position: dict[str, float]


class Recorder:
    """A provider of verbs, one of which sets a parameter."""

    task_parameter = "pick"

    @verb(moves=False, sets="task")
    def task(self, request: Text) -> str:
        """Record another task."""
        if request.text == "dance":
            raise RefusedError("the robot does not dance")
        self.task_parameter = request.text
        return f"the task is {request.text}"

    @verb(moves=False)
    def place(self, request: Where) -> str:
        """Put it somewhere."""
        return str(request.position)

    @verb(moves=True)
    def resume(self) -> str:
        """End a fault."""
        return "torque is on again"


class Graph:
    """Node and publisher in the graph: keeps what is declared and published."""

    def __init__(self) -> None:
        self.services: dict[str, tuple[str, Callable[[bytes], bytes]]] = {}
        self.events: list[Any] = []

    def create_service(self, name: str, kind: str, serve: Callable[[bytes], bytes]) -> None:
        self.services[name] = kind, serve

    def publish(self, cdr: Any) -> None:
        self.events.append(decode("rcl_interfaces/msg/ParameterEvent", cdr))

    def call(self, name: str, values: dict[str, Any]) -> Any:
        kind, serve = self.services[f"/recorder/{name}"]
        return decode(f"{kind}_Response", serve(bytes(encode(build(f"{kind}_Request", values)))))


@pytest.fixture
def node() -> tuple[Graph, Any]:
    spec = NodeSpec(
        name="recorder",
        kind=NodeKind.SERVICE,
        behaviour="x:X",
        implementation="x:X",
        settings={"fps": 30, "video": {"crf": 23}},
    )
    context, graph, verbs = RecordingContext(spec), Graph(), verbs_of([Recorder()])

    def ask(name: str, payload: dict[str, Any]) -> CallReply:
        try:
            return CallReply(id=1, node="/recorder", ok=True, payload=verbs[name].bind(payload)())
        except (RefusedError, InvalidRequestError) as error:
            return CallReply(id=1, node="/recorder", ok=False, code="refused", text=str(error))

    handle: Any = graph
    offer(ExtendedNode(context, handle, tuple(verbs.values()), ask, handle))
    return graph, context


def parameter(name: str, **value: Any) -> dict[str, Any]:
    return {"name": name, "value": value}


def test_a_parameter_is_set_by_its_verb_and_the_change_is_published(node: tuple[Graph, Any]) -> None:
    graph, _ = node
    assert [it.name for it in graph.events[0].new_parameters] == ["use_sim_time", "fps", "video.crf", "task"]
    done = graph.call("set_parameters", {"parameters": [parameter("task", type=4, string_value="place")]})
    assert [(it.successful, it.reason) for it in done.results] == [(True, "the task is place")]
    (changed,) = graph.events[1].changed_parameters
    assert (graph.events[1].node, changed.name, changed.value.string_value) == ("/recorder", "task", "place")
    assert graph.call("get_parameters", {"names": ["task"]}).values[0].string_value == "place"
    assert graph.call("list_parameters", {"prefixes": ["video"]}).result.names == ["video.crf"]


@pytest.mark.parametrize(
    ("item", "reason"),
    [
        (parameter("task", type=4, string_value="dance"), "the robot does not dance"),
        (parameter("task", type=2, integer_value=1), "task is of type str"),
        (
            parameter("fps", type=2, integer_value=60),
            "the parameter is set in the configuration file: change it there and restart the run",
        ),
        (parameter("speed", type=3, double_value=1.0), "no parameter 'speed'"),
    ],
)
def test_a_parameter_that_cannot_be_set_is_refused_with_the_reason(
    node: tuple[Graph, Any], item: dict[str, Any], reason: str
) -> None:
    graph, _ = node
    (result,) = graph.call("set_parameters", {"parameters": [item]}).results
    assert (result.successful, result.reason) == (False, reason)
    single = graph.call("set_parameters_atomically", {"parameters": [item]}).result
    assert (single.successful, single.reason) == (False, reason)
    assert len(graph.events) == 1


def test_several_parameters_are_not_set_at_once(node: tuple[Graph, Any]) -> None:
    graph, _ = node
    items = [parameter("task", type=4, string_value=text) for text in ("a", "b")]
    result = graph.call("set_parameters_atomically", {"parameters": items}).result
    assert (result.successful, result.reason) == (
        False,
        "parameters are set one at a time: use set_parameters",
    )
    assert graph.call("get_parameters", {"names": ["task"]}).values[0].string_value == "pick"


def test_a_request_has_the_fields_that_the_names_say(node: tuple[Graph, Any]) -> None:
    graph, _ = node
    items = [parameter(f"position.{name}", type=3, double_value=0.5) for name in ("pan", "lift")]
    result = graph.call("place", {"parameters": items}).result
    assert (result.successful, result.reason) == (True, "{'pan': 0.5, 'lift': 0.5}")
    wrong = graph.call("place", {"parameters": [parameter("positoin.pan", type=3)]}).result
    assert not wrong.successful
    assert "positoin: no such field; did you mean position?" in wrong.reason


def test_a_node_with_a_fault_is_inactive_and_is_activated_by_its_verb(
    node: tuple[Graph, Any], caplog: pytest.LogCaptureFixture
) -> None:
    graph, context = node
    assert graph.call("get_state", {}).current_state.label == "active"
    with caplog.at_level(logging.WARNING):
        assert not graph.call("change_state", CHANGE).success
    assert "asked for the transition activate, but the node is active: refused" in caplog.text
    context.fault("overload")
    assert graph.call("get_state", {}).current_state.label == "inactive"
    (offered,) = graph.call("get_available_transitions", {}).available_transitions
    assert (offered.transition.label, offered.goal_state.label) == ("activate", "active")
    assert graph.call("change_state", CHANGE).success
    assert not graph.call("change_state", {"transition": {"id": 4}}).success
    states = graph.call("get_available_states", {}).available_states
    assert [state.label for state in states] == ["inactive", "active"]

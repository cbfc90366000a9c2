"""What a node declares is ready before its loop turns."""

from __future__ import annotations

import logging
from types import SimpleNamespace
from typing import Any

import pytest
from joshua.messages import encode, message_class
from joshua.messages.typestore import typestore
from joshua.node import ros_time
from joshua.node.endpoints import Endpoints
from joshua.plan import NodeKind, NodeSpec, TopicSpec
from joshua.transport import Sample

TYPE = "sensor_msgs/msg/BatteryState"
SPEC = NodeSpec(name="node", kind=NodeKind.SENSOR, behaviour="", implementation="")


@pytest.mark.parametrize("declare", ["publisher", "subscribe"])
def test_no_codec_is_left_to_be_compiled_by_the_first_message(
    declare: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Compiling one takes longer than a control loop may stand still on a busy machine."""
    handle: Any = SimpleNamespace(
        create_publisher=lambda *_, **__: SimpleNamespace(), create_subscription=lambda *_, **__: None
    )
    endpoints = Endpoints(handle, SPEC, lambda _: None, lambda _: None, logging.getLogger())
    monkeypatch.delitem(typestore().cache, TYPE, raising=False)
    topic = TopicSpec(name="/battery", type_name=TYPE)
    if declare == "publisher":
        endpoints.publisher(topic)
    else:
        endpoints.subscribe(topic, lambda *_: None)
    assert TYPE in typestore().cache


@pytest.mark.parametrize("simulated_ns", [None, 5])
@pytest.mark.parametrize("declare", ["subscribe", "subscribe_with_writer"])
def test_a_message_is_received_on_the_clock_of_the_stamps(
    declare: str, simulated_ns: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ros_time, "_simulated_ns", simulated_ns)
    receive: list[Any] = []

    def create(*arguments: Any, **_: Any) -> None:
        receive.append(arguments[3])

    handle: Any = SimpleNamespace(create_subscription=create, publisher_node=lambda _: "/peer")
    endpoints = Endpoints(handle, SPEC, lambda _: None, lambda _: None, logging.getLogger())
    topic = TopicSpec(name="/seen", type_name="std_msgs/msg/Bool")
    received: list[int] = []
    figures = getattr(endpoints, declare)(topic, lambda _, at_ns, *__: received.append(at_ns))
    cdr = encode(message_class("std_msgs/msg/Bool")(data=True))
    receive[0](Sample(cdr, 1000, 1700, 1, b"x"))
    receive[0](Sample(cdr, 0, 1800, 2, b"x"))  # of a publisher that sends no time
    assert received == ([1700, 1800] if simulated_ns is None else [5, 5])
    assert list(figures.transits_ns) == [700]  # of the computers' clocks, simulated or not

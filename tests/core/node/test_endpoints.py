"""What a node declares is ready before its loop turns."""

from __future__ import annotations

import logging
from types import SimpleNamespace
from typing import Any

import pytest
from joshua.messages.typestore import typestore
from joshua.node.endpoints import Endpoints
from joshua.plan import NodeKind, NodeSpec, TopicSpec

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

"""The graph over DDS in a process that never asks for it."""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import Any

import pytest
from joshua.plan import QosProfile, TransportSpec
from joshua.transport import Transport

pytest.importorskip("cyclonedds")

from cyclonedds.core import InstanceState, ReadCondition, SampleState, ViewState

ANY = SampleState.Any | ViewState.Any
GONE = ANY | InstanceState.NotAliveDisposed | InstanceState.NotAliveNoWriters


def kept(watcher: Any) -> int:
    """Samples that the readers of a graph hold of what has been announced, and of what has left."""
    graph = watcher.graph
    with graph._lock:
        readers = [(graph._reader, ANY | InstanceState.Any), *((entry[0], GONE) for entry in graph._builtin)]
        return sum(len(reader.read(1000, ReadCondition(reader, mask))) for reader, mask in readers)


def test_what_others_announce_and_close_is_not_kept(
    opener: Callable[[TransportSpec], Transport], eventually: Callable[..., Any]
) -> None:
    spec = TransportSpec(kind="dds", domain_id=random.randrange(233))
    watcher: Any = opener(spec)
    other: Any = opener(spec)
    guid = other.participant.guid.bytes
    node = other.create_node("busy")
    for number in range(50):
        node.create_publisher(f"/topic_{number}", "std_msgs/msg/String", QosProfile()).close()
    staying = node.create_publisher("/staying", "std_msgs/msg/String", QosProfile())
    gid = staying.gid
    # nobody asks: the thread alone has taken all of it
    eventually(lambda: any(gid in e.writers for e in watcher.graph._others.get(guid, ())))
    eventually(lambda: kept(watcher) == 0, what="an empty reader")
    assert watcher.graph.owner(gid) == "/busy"

    other.close()
    eventually(lambda: guid not in watcher.graph._others, what="a forgotten participant")
    eventually(lambda: kept(watcher) == 0, what="an empty reader")
    assert watcher.graph.owner(gid) == ""

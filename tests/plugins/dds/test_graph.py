"""The graph over DDS: what a process keeps that never asks for it, and what one gets that asks often."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import pytest
from joshua.messages import type_hash
from joshua.plan import QosProfile, TransportSettings
from joshua.transport import Transport

pytest.importorskip("cyclonedds")

from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication, BuiltinTopicDcpsSubscription
from cyclonedds.core import InstanceState, ReadCondition, SampleState, ViewState
from joshua_dds.qos import read_type_hash

ANY = SampleState.Any | ViewState.Any
UINT32 = "std_msgs/msg/UInt32"
LOOKS = 1000  # of each thread; some of them went wrong in most runs
GONE = ANY | InstanceState.NotAliveDisposed | InstanceState.NotAliveNoWriters


def kept(watcher: Any) -> int:
    """Samples that the readers of a graph hold of what has been announced, and of what has left."""
    graph = watcher.graph
    with graph._lock:
        readers = [(graph._reader, ANY | InstanceState.Any), *((entry[0], GONE) for entry in graph._builtin)]
        return sum(len(reader.read(1000, ReadCondition(reader, mask))) for reader, mask in readers)


def test_what_others_announce_and_close_is_not_kept(
    dds_spec: TransportSettings,
    opener: Callable[[TransportSettings], Transport],
    eventually: Callable[..., Any],
) -> None:
    watcher: Any = opener(dds_spec)
    other: Any = opener(dds_spec)
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


def test_who_publishes_and_the_graph_are_read_at_once(dds_spec, opener, eventually, caplog):
    """The library reads QoS values through buffers that all threads share."""
    transport = opener(dds_spec)
    node = transport.create_node("busy")
    topics = [f"/topic_{number}" for number in range(8)]
    publishers = [node.create_publisher(topic, UINT32, QosProfile(depth=3)) for topic in topics]
    subscriptions = [
        node.create_subscription(topic, UINT32, QosProfile(), lambda _: None) for topic in topics
    ]
    eventually(lambda: all(item.publisher_count for item in subscriptions))
    wrong = []

    def look_up(publisher, subscription):
        (handle,) = subscription.entity.get_matched_publications()
        for _ in range(LOOKS):
            subscription._gids.clear()
            if subscription._look_up(handle) != publisher.gid:
                wrong.append(subscription.name)

    threads = [
        threading.Thread(target=look_up, args=pair) for pair in zip(publishers, subscriptions, strict=True)
    ]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        (seen,) = transport.nodes()
        depths = {item.qos.depth for item in seen.endpoints if item.is_publisher}
        if depths != {3}:
            wrong.append(depths)
    for thread in threads:
        thread.join()
    assert (wrong, caplog.text) == ([], "")


def test_the_endpoints_of_the_graph_tell_their_type_hash(dds_spec, opener, eventually):
    """rmw_cyclonedds warns of each endpoint without one."""
    shown, watcher = opener(dds_spec), opener(dds_spec)
    mine = shown.participant.guid
    for kind in (BuiltinTopicDcpsPublication, BuiltinTopicDcpsSubscription):
        reader = BuiltinDataReader(watcher.participant, kind)

        def graph_endpoints(reader: Any = reader) -> list[str]:
            samples = reader.read(1000)
            return [
                read_type_hash(sample.qos)
                for sample in samples
                if sample.topic_name == "ros_discovery_info" and sample.participant_key == mine
            ]

        assert eventually(graph_endpoints) == [type_hash("rmw_dds_common/msg/ParticipantEntitiesInfo")]

"""An unmodified ROS 2 and JOSHUA over DDS: graph, types, QoS, images, and processes that are killed."""

from __future__ import annotations

import json
import random
import time
from typing import Any

import numpy as np
import pytest
from joshua.messages import decode, encode, known_types, make, message_class, type_hash
from joshua.messages.fields import build, to_plain
from joshua.messages.services import SERVICES
from joshua.plan import QosProfile
from joshua.plan.qos import qos_clashes
from joshua.schema.data_types import type_names
from joshua_services.action_types import CANCEL, define_action, define_types
from random_messages import plain, random_fields

STRING = "std_msgs/msg/String"
IMAGE = "sensor_msgs/msg/Image"
PROFILES: list[dict[str, Any]] = [
    {"reliability": reliability, "durability": durability}
    for reliability in ("RELIABLE", "BEST_EFFORT")
    for durability in ("VOLATILE", "TRANSIENT_LOCAL")
]


def string(text):
    return encode(message_class(STRING)(text))


def test_every_type_hash_is_that_of_ros_2(share):
    define_types()
    fibonacci = "test_msgs/action/Fibonacci"  # an action is derived as every other one
    define_action(fibonacci, "int32 order", "int32[] sequence", "int32[] sequence")
    derived = {f"{fibonacci}_{part}" for part in ("Goal", "Result", "Feedback", "FeedbackMessage")}
    known = {*known_types(), *SERVICES, *derived}
    hashes = {
        item["type_name"]: item["hash_string"]
        for path in share.glob("*/*/*.json")
        for item in json.loads(path.read_text()).get("type_hashes", ())
        if item["type_name"] in known
    }
    assert len(hashes) > 100
    asked = {*derived, f"{fibonacci}_SendGoal", f"{fibonacci}_GetResult", CANCEL}
    assert asked <= hashes.keys()
    assert {name: type_hash(name) for name in hashes} == hashes


def test_each_side_lists_the_nodes_types_and_qos_of_the_other(dds_spec, opener, peer, eventually):
    transport = opener(dds_spec)
    node = transport.create_node("ours", "/left")
    node.create_publisher("/left/state", STRING, QosProfile(reliability="BEST_EFFORT"))
    peer.publish("/stock/state", STRING, {"durability": "TRANSIENT_LOCAL"}, [])
    eventually(lambda: "/left/ours" in peer.graph()["nodes"])
    eventually(lambda: peer.publishers("/left/state"))
    assert peer.graph()["topics"]["/left/state"] == [STRING]
    assert peer.parameters("/left/ours") is None, "no parameter services over DDS, and that is known at once"
    (seen,) = peer.publishers("/left/state")
    assert seen == {
        "node": "/left/ours",
        "type": STRING,
        "hash": type_hash(STRING),
        "reliability": "BEST_EFFORT",
        "durability": "VOLATILE",
    }

    def stock():
        return [
            endpoint
            for found in transport.nodes()
            if (found.namespace, found.name) == ("/stock", "peer")
            for endpoint in found.endpoints
            if endpoint.topic == "/stock/state"
        ]

    (endpoint,) = eventually(stock)
    assert (endpoint.type_name, endpoint.type_hash) == (STRING, type_hash(STRING))
    assert (endpoint.qos.reliability, endpoint.qos.durability) == ("RELIABLE", "TRANSIENT_LOCAL")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("ours", "theirs"), [("LOCALHOST", "LOCALHOST"), ("LOCALHOST", "SUBNET"), ("SUBNET", "SUBNET")]
)
def test_these_discovery_ranges_meet_on_one_machine(dds_spec, opener, start_peer, eventually, ours, theirs):
    """The table of guides/transport.md."""
    peer = start_peer(ROS_AUTOMATIC_DISCOVERY_RANGE=theirs)
    transport = opener(dds_spec.model_copy(update={"discovery_range": ours}))
    publisher = transport.create_node("ours", "/left").create_publisher("/left/said", STRING, QosProfile())
    peer.subscribe("/left/said", STRING, {})
    eventually(lambda: publisher.publish(string("a")) or peer.count("/left/said"))
    eventually(lambda: "/left/ours" in peer.graph()["nodes"])
    eventually(lambda: any(node.name == "peer" for node in transport.nodes()))


def test_every_type_goes_through_ros_2_and_comes_back_equal(dds_spec, opener, peer, eventually):
    types = peer.known(type_names())
    assert len(types) > 90
    node = opener(dds_spec).create_node("ours")
    got = {}
    rng = random.Random(11)
    for first in range(0, len(types), 30):  # as many endpoints as a small participant takes at a time
        part = dict(enumerate(types[first : first + 30], first))
        ends = [
            (
                node.create_publisher(f"/t{number}/ping", name, QosProfile()),
                node.create_subscription(
                    f"/t{number}/pong", name, QosProfile(), lambda sample, n=number: got.setdefault(n, sample)
                ),
            )
            for number, name in part.items()
        ]
        peer.echo([(f"/t{number}", name) for number, name in part.items()])
        eventually(lambda ends=ends: all(p.subscription_count and s.publisher_count for p, s in ends))
        sent = {number: random_fields(name, rng) for number, name in part.items()}
        for _ in range(100):  # what is sent before the reader of the other side is ready is lost
            missing = [number for number in part if number not in got]
            for number in missing:
                ends[number - first][0].publish(encode(build(part[number], sent[number])))
            if not missing:
                break
            eventually(lambda missing=missing: any(n in got for n in missing), timeout_s=5)
        for number, name in part.items():
            assert plain(to_plain(decode(name, got[number].cdr))) == sent[number], name
        for publisher, subscription in ends:
            publisher.close()
            subscription.close()


@pytest.mark.parametrize("offered", PROFILES, ids=lambda p: "-".join(p.values()))
def test_profiles_connect_by_the_rules_of_ros_2(dds_spec, opener, peer, eventually, offered):
    node = opener(dds_spec).create_node("ours")
    for number, requested in enumerate(PROFILES):
        clash = qos_clashes(QosProfile(**offered), QosProfile(**requested))
        ours, theirs = f"/ours/t{number}", f"/theirs/t{number}"
        events, texts = [], []
        publisher = node.create_publisher(
            ours, STRING, QosProfile(**offered), on_event=lambda name, _, e=events: e.append(name)
        )
        node.create_subscription(
            theirs,
            STRING,
            QosProfile(**requested),
            lambda sample, t=texts: t.append(decode(STRING, sample.cdr).data),
            on_event=lambda name, _, e=events: e.append(name),
        )
        peer.subscribe(ours, STRING, requested)
        peer.publish(theirs, STRING, offered, [])
        if clash:
            eventually(lambda e=events: e.count("incompatible-qos") == 2)
            assert (publisher.subscription_count, peer.matched(theirs)) == (0, 0)
            continue
        eventually(lambda p=publisher, t=theirs: p.subscription_count == 1 and peer.matched(t) == 1)

        def say(publisher=publisher, ours=ours, theirs=theirs):
            publisher.publish(string("a"))
            peer.publish(theirs, STRING, offered, ["b"])

        def arrived(say=say, ours=ours, texts=texts):
            say()
            return peer.count(ours) and texts

        eventually(arrived)
        assert events == []


def test_a_late_reader_gets_what_is_kept_for_it(dds_spec, opener, peer, eventually):
    kept: dict[str, Any] = {"durability": "TRANSIENT_LOCAL", "depth": 3}
    node = opener(dds_spec).create_node("ours")
    publisher = node.create_publisher("/ours/kept", STRING, QosProfile(**kept))
    for text in "abcde":
        publisher.publish(string(text))
    peer.publish("/theirs/kept", STRING, kept, list("vwxyz"))
    peer.subscribe("/ours/kept", STRING, kept)
    eventually(lambda: peer.texts("/ours/kept") == ["c", "d", "e"])
    texts = []
    node.create_subscription(
        "/theirs/kept", STRING, QosProfile(**kept), lambda s: texts.append(decode(STRING, s.cdr).data)
    )
    eventually(lambda: texts == ["x", "y", "z"])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("width", "height", "rate_hz"), [(640, 480, 30), (640, 480, 200), (1280, 720, 60), (1920, 1080, 30)]
)
def test_reliable_raw_images_arrive_and_go_on_arriving(
    dds_spec, opener, peer, eventually, width, height, rate_hz
):
    """With a writer that replaces what a reader has in part, the last three hang the reader for ever."""
    payload = encode(make.image(np.random.default_rng(1).integers(0, 256, (height, width, 3), np.uint8)))
    publisher = opener(dds_spec).create_node("camera").create_publisher("/image", IMAGE, QosProfile())
    peer.subscribe("/image", IMAGE, {})
    eventually(lambda: publisher.subscription_count)

    def stream(seconds):
        began_s = time.monotonic()
        for number in range(rate_hz * seconds):
            publisher.publish(payload)
            time.sleep(max(0.0, began_s + (number + 1) / rate_hz - time.monotonic()))
        return peer.count("/image")

    first = stream(2)
    assert first > 10
    assert stream(2) > first
    time.sleep(1)  # what is on its way
    before_s = peer.cpu_s()
    time.sleep(1)
    assert peer.cpu_s() - before_s < 0.5


@pytest.mark.slow
def test_a_killed_ros_2_process_leaves_and_its_successor_is_found(dds_spec, opener, start_peer, eventually):
    transport = opener(dds_spec)
    node = transport.create_node("ours")
    publisher = node.create_publisher("/ours/state", STRING, QosProfile())
    first = start_peer()
    first.subscribe("/ours/state", STRING, {})
    eventually(lambda: publisher.subscription_count == 1)
    first.kill()
    second = start_peer()
    second.subscribe("/ours/state", STRING, {})

    def arrived():
        publisher.publish(string("a"))
        return second.count("/ours/state")

    eventually(arrived)
    # the killed one keeps its place until its lease ends
    eventually(lambda: publisher.subscription_count == 1, timeout_s=90)


@pytest.mark.slow
def test_a_killed_process_of_ours_leaves_and_its_successor_is_found(dds_spec, program, peer, eventually):
    peer.subscribe("/topic", STRING, {})
    first = program("stay.py", dds_spec.model_dump_json())
    assert first.stdout.readline() == "ready\n"
    eventually(lambda: "/stay" in peer.graph()["nodes"])
    first.kill()
    eventually(lambda: "/stay" not in peer.graph()["nodes"])
    program("stay.py", dds_spec.model_dump_json())
    eventually(lambda: "/stay" in peer.graph()["nodes"])

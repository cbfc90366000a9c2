"""Publishing and subscribing between real processes on both transports, and the graph."""

from __future__ import annotations

import signal
import threading
import time

import numpy as np
import pytest
from joshua.messages import MessageError, decode, encode, make
from joshua.plan import QosProfile
from joshua.testing.domain import reserved_domain
from joshua.transport import TransportError

JOINT_STATE = "sensor_msgs/msg/JointState"


def test_messages_go_to_another_process_and_back(spec, opener, program, eventually):
    far = program("echo.py", spec.model_dump_json(), JOINT_STATE)
    transport = opener(spec)
    node = transport.create_node("near", "/left")
    got = []
    publisher = node.create_publisher("/ping", JOINT_STATE, QosProfile())
    subscription = node.create_subscription("/pong", JOINT_STATE, QosProfile(), got.append)
    eventually(lambda: publisher.subscription_count == 1 and subscription.publisher_count == 1)
    assert far.stdout.readline() == "ready\n"

    before_ns = time.time_ns()
    for number in range(5):
        publisher.publish(encode(make.joint_state(["a", "b"], np.full(2, number), at_ns=number)))
    eventually(lambda: len(got) == 5)
    assert [decode(JOINT_STATE, sample.cdr).position[0] for sample in got] == [0, 1, 2, 3, 4]
    # the wire of DDS carries no running number
    assert [sample.sequence for sample in got] == ([1, 2, 3, 4, 5] if spec.kind == "zenoh" else [0] * 5)
    for sample in got:
        assert before_ns <= sample.source_stamp_ns <= sample.received_ns <= time.time_ns()
        assert len(sample.publisher_gid) == 16

    both_ends = {("/ping", JOINT_STATE, False), ("/pong", JOINT_STATE, True)}

    def graph():
        return {
            f"{n.namespace}:{n.name}": {(e.topic, e.type_name, e.is_publisher) for e in n.endpoints}
            for n in transport.nodes()
        }

    # which node owns an endpoint is told apart from the endpoint, and may come after its messages
    others_ends = {(topic, kind, not is_publisher) for topic, kind, is_publisher in both_ends}
    eventually(lambda: graph() == {"/far:echo": both_ends, "/left:near": others_ends}, what="the graph")
    assert {e.qos for n in transport.nodes() for e in n.endpoints} == {QosProfile()}

    far.send_signal(signal.SIGKILL)
    eventually(lambda: [n.name for n in transport.nodes()] == ["near"], what="the killed node's leave")
    eventually(lambda: publisher.subscription_count == 0 and subscription.publisher_count == 0)


def test_a_message_tells_which_node_sent_it(spec, opener, program, eventually):
    far = program("echo.py", spec.model_dump_json(), JOINT_STATE)
    transport = opener(spec)
    node = transport.create_node("near")
    got = []
    publisher = node.create_publisher("/ping", JOINT_STATE, QosProfile())
    own = node.create_publisher("/pong", JOINT_STATE, QosProfile())
    node.create_subscription("/pong", JOINT_STATE, QosProfile(), got.append)
    eventually(lambda: publisher.subscription_count == 1 and own.subscription_count == 1)
    assert far.stdout.readline() == "ready\n"
    own.publish(encode(make.joint_state([], ())))
    eventually(lambda: got)
    publisher.publish(encode(make.joint_state([], ())))
    eventually(lambda: len(got) == 2)
    senders = ["/near", "/far/echo"]
    eventually(lambda: [node.publisher_node(sample.publisher_gid) for sample in got] == senders)
    assert node.publisher_node(bytes(16)) == ""


def test_a_closed_node_leaves_the_graph_and_its_callbacks_end(spec, opener, eventually):
    near, far = opener(spec), opener(spec)
    got = []
    node = far.create_node("listener")
    node.create_subscription("/topic", JOINT_STATE, QosProfile(), got.append)
    publisher = near.create_node("talker").create_publisher("/topic", JOINT_STATE, QosProfile())
    eventually(lambda: publisher.subscription_count == 1)
    node.close()
    node.close()
    publisher.publish(encode(make.joint_state([], ())))
    eventually(lambda: publisher.subscription_count == 0)
    assert not got
    with pytest.raises(TransportError, match="the node listener is closed"):
        node.create_publisher("/topic", JOINT_STATE, QosProfile())


def test_nodes_of_one_process_hear_each_other(spec, opener, eventually):
    transport = opener(spec)
    got = []
    transport.create_node("a").create_subscription("/topic", JOINT_STATE, QosProfile(), got.append)
    publisher = transport.create_node("b").create_publisher("/topic", JOINT_STATE, QosProfile())
    publisher.publish(memoryview(encode(make.joint_state(["x"], [1.0]))))
    eventually(lambda: got)
    eventually(lambda: publisher.subscription_count == 1)


def test_domains_do_not_meet(spec, opener, eventually):
    with reserved_domain() as other:
        near, far = opener(spec), opener(spec.model_copy(update={"domain_id": other}))
        far.create_node("elsewhere")
        node = near.create_node("here")
        witness = opener(spec)
        eventually(lambda: [n.name for n in witness.nodes()] == ["here"])
        eventually(lambda: [n.name for n in far.nodes()] == ["elsewhere"])
        assert [n.name for n in near.nodes()] == ["here"]
        node.close()
        far.close()


def test_a_failing_callback_does_not_end_the_subscription(spec, opener, eventually, caplog):
    transport = opener(spec)
    got = []

    def callback(sample):
        got.append(sample)
        if len(got) == 1:
            raise RuntimeError("first one fails")

    node = transport.create_node("a")
    node.create_subscription("/topic", JOINT_STATE, QosProfile(), callback)
    publisher = node.create_publisher("/topic", JOINT_STATE, QosProfile())
    for _ in range(2):
        publisher.publish(encode(make.joint_state([], ())))
    eventually(lambda: len(got) == 2)
    assert "the callback of joshua-sub /topic failed" in caplog.text


def test_a_callback_may_close_its_own_subscription(spec, opener, eventually):
    node = opener(spec).create_node("a")
    got, closed = [], threading.Event()

    def callback(sample):
        got.append(sample)
        subscriptions[0].close()
        closed.set()

    subscriptions = [node.create_subscription("/topic", JOINT_STATE, QosProfile(), callback)]
    publisher = node.create_publisher("/topic", JOINT_STATE, QosProfile())
    eventually(lambda: publisher.subscription_count == 1)
    for _ in range(5):
        publisher.publish(encode(make.joint_state([], ())))
    assert closed.wait(30)
    eventually(lambda: publisher.subscription_count == 0)
    assert len(got) == 1


@pytest.mark.parametrize("topic", ["joints", "/a//b", "/1st", "/a__b", "/", "/ä"])
def test_invalid_topics_are_refused(spec, opener, topic):
    node = opener(spec).create_node("a")
    with pytest.raises(TransportError, match="is not a fully qualified topic name"):
        node.create_publisher(topic, JOINT_STATE, QosProfile())


def test_invalid_names_and_types_are_refused(spec, opener):
    transport = opener(spec)
    with pytest.raises(TransportError, match="'left arm' is not a node name"):
        transport.create_node("left arm")
    with pytest.raises(TransportError, match="'left' is not a namespace"):
        transport.create_node("arm", "left")
    with pytest.raises(MessageError, match="not known"):
        transport.create_node("arm").create_publisher("/a", "sensor_msgs/msg/Nothing", QosProfile())

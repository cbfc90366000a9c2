"""Programs that share no code with ours hear us and are heard: the wire is ROS 2's."""

from __future__ import annotations

import json
import threading

import pytest
from joshua.messages import decode, encode, make, message_class
from joshua.plan import QosProfile
from joshua.transport.zenoh.endpoints import read_endpoint

STRING = "std_msgs/msg/String"
STRING_HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
JOINT_STATE = "sensor_msgs/msg/JointState"
JOINT_STATE_HASH = "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e"


def endpoints(transport):
    return {
        (f"{node.namespace.rstrip('/')}/{node.name}", endpoint.topic, endpoint.is_publisher): endpoint
        for node in transport.nodes()
        for endpoint in node.endpoints
    }


def publish_until_it_answers(publisher, message, peer):
    answered = []
    thread = threading.Thread(target=lambda: answered.append(peer.stdout.readline()))
    thread.start()
    while thread.is_alive():
        publisher.publish(message)
        thread.join(0.05)
    return answered[0]


def test_zenoh_ros2_sdk(zenoh_spec, router, opener, program, eventually):
    port = read_endpoint(zenoh_spec.listen_endpoints[0]).port
    peer = program("sdk_peer.py", port, zenoh_spec.domain_id)
    transport = opener(zenoh_spec)
    node = transport.create_node("ours", "/left")
    got = []
    node.create_subscription("/from_sdk", STRING, QosProfile(), got.append)
    events = []
    # rmw_zenoh connects it with the reliable subscription of the SDK all the same, so nothing is warned about
    best_effort = QosProfile(reliability="BEST_EFFORT", depth=5)
    publisher = node.create_publisher(
        "/to_sdk", STRING, best_effort, on_event=lambda *event: events.append(event)
    )
    assert peer.stdout.readline() == "ready\n"
    eventually(lambda: got, what="a message of the SDK")
    assert decode(STRING, got[0].cdr).data == "hello from the sdk"

    both = {("/sdk_listener", "/to_sdk", False), ("/sdk_talker", "/from_sdk", True)}
    seen = eventually(lambda: (found := endpoints(transport)) and both <= set(found) and found)
    talker = seen["/sdk_talker", "/from_sdk", True]
    assert (talker.type_name, talker.type_hash) == (STRING, STRING_HASH)

    eventually(lambda: publisher.subscription_count == 1)
    message = encode(message_class(STRING)("hello from joshua"))
    # the SDK shows its token before it listens, so that one message might come too early
    report = json.loads(publish_until_it_answers(publisher, message, peer))
    assert report == {
        "heard": "hello from joshua",
        "namespace": "/left",
        "node_name": "ours",
        "dds_type": "std_msgs::msg::dds_::String_",
        "type_hash": STRING_HASH,
        "qos": "2::,5:,:,:,,",
    }
    assert events == []


@pytest.mark.parametrize("distro", ["jazzy", "humble"])
def test_plain_cyclonedds(dds_spec, opener, program, eventually, distro):
    spec = dds_spec.model_copy(update={"distro": distro})
    peer = program("dds_peer.py", spec.domain_id, distro)
    transport = opener(spec)
    node = transport.create_node("ours", "/left")
    got = []
    node.create_subscription("/from_peer", STRING, QosProfile(), got.append)
    publisher = node.create_publisher("/to_peer", JOINT_STATE, QosProfile())
    assert peer.stdout.readline() == "ready\n"
    eventually(lambda: got, what="a message of the peer")
    assert decode(STRING, got[0].cdr).data == "hello from dds"
    assert len(got[0].publisher_gid) == 16

    both = {("/bare/dds_peer", "/to_peer", False), ("/bare/dds_peer", "/from_peer", True)}
    seen = eventually(lambda: (found := endpoints(transport)) and both <= set(found) and found)
    assert {node.name for node in transport.nodes()} == {"ours", "dds_peer"}, (
        "and none with control characters"
    )
    talker = seen["/bare/dds_peer", "/from_peer", True]
    assert talker.type_name == STRING
    assert talker.type_hash == ("TypeHashNotSupported" if distro == "humble" else STRING_HASH)
    assert talker.qos == QosProfile()

    eventually(lambda: publisher.subscription_count == 1)
    # our side has found the reader, and the reader may not have found our side yet
    message = encode(make.joint_state(["a", "b"], [0.5, -1.5], frame_id="base"))
    report = json.loads(publish_until_it_answers(publisher, message, peer))
    peer.stdin.write("end\n")
    peer.stdin.flush()
    assert report == {
        "name": ["a", "b"],
        "position": [0.5, -1.5],
        "frame": "base",
        "nodes": [["/left", "ours"]],
        "type": "sensor_msgs::msg::dds_::JointState_",
        "user_data": "" if distro == "humble" else f"typehash={JOINT_STATE_HASH};",
    }


def test_a_stock_ros_2_with_the_range_localhost_meets_ours(dds_spec, opener, program, eventually):
    peer = program("dds_peer.py", dds_spec.domain_id, "jazzy", "stock")
    got = []
    opener(dds_spec).create_node("ours").create_subscription("/from_peer", STRING, QosProfile(), got.append)
    assert peer.stdout.readline() == "ready\n"
    eventually(lambda: got, what="a message of the peer")


def test_endpoints_that_no_node_owns_are_listed_as_ros_2_lists_them(dds_spec, opener, program, eventually):
    # a peer of another distribution announces its node in a form that does not match
    peer = program("dds_peer.py", dds_spec.domain_id, "humble")
    transport = opener(dds_spec)
    assert peer.stdout.readline() == "ready\n"
    bare = "_CREATED_BY_BARE_DDS_APP_"
    eventually(lambda: (f"{bare}/{bare}", "/from_peer", True) in endpoints(transport))

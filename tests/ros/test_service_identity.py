"""Why nodes offer no services over DDS (decision 0011): cyclonedds beside ROS 2's own rclpy.

Should one of these tests fail after an update of cyclonedds, services over DDS may have become possible.
"""

from __future__ import annotations

import threading
import time

from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from joshua.messages import decode, encode, message_class
from joshua.plan import QosProfile
from joshua_dds import raw
from joshua_dds.qos import endpoint_qos
from joshua_dds.taking import Taker
from joshua_dds.types import idl_type

REQUEST, RESPONSE = "std_srvs/srv/Trigger_Request", "std_srvs/srv/Trigger_Response"


def topic_of(transport, topic, type_name):
    message_class(type_name)  # loads the definitions of services
    return Topic(transport.participant, topic, idl_type(type_name))


def qos(type_name, is_writer):
    return endpoint_qos(QosProfile(), type_name, is_writer=is_writer)


def writer(transport, topic, type_name):
    made = topic_of(transport, topic, type_name)
    return DataWriter(transport.participant, made, qos=qos(type_name, True))


def reader(transport, topic, type_name):
    made = topic_of(transport, topic, type_name)
    return DataReader(transport.participant, made, qos=qos(type_name, False))


def taken(entity, eventually):
    taker = Taker(entity)

    def data():
        sample = taker.take()
        return sample if sample is not None and sample.cdr is not None else None

    return eventually(data)


def test_a_client_of_ros_2_drops_a_response_that_names_no_request(dds_spec, opener, peer, eventually):
    transport = opener(dds_spec)
    requests = reader(transport, "rq/ours/stopRequest", REQUEST)
    responses = writer(transport, "rr/ours/stopReply", RESPONSE)
    answers = []
    call = threading.Thread(target=lambda: answers.append(peer.call("/ours/stop", 3.0)))
    call.start()
    request = taken(requests, eventually)
    # encapsulation header, and the byte of an empty message: no number of the request, no client
    assert bytes(request.cdr)[:4] == b"\0\1\0\0"
    assert not any(bytes(request.cdr)[4:])
    assert set(request._fields) == {"cdr", "source_timestamp_ns", "publication_handle"}
    eventually(responses.get_matched_subscriptions)
    assert raw.write(responses, encode(message_class(RESPONSE)(success=True, message="ours")))
    call.join()
    assert answers == [None]


def test_a_server_of_ros_2_answers_and_the_answer_does_not_say_whom(dds_spec, opener, peer, eventually):
    transport = opener(dds_spec)
    peer.serve("/theirs/stop")
    requests = [writer(transport, "rq/theirs/stopRequest", REQUEST) for _ in range(2)]
    responses = [reader(transport, "rr/theirs/stopReply", RESPONSE) for _ in range(2)]
    for end in requests:
        eventually(end.get_matched_subscriptions)
    for end in responses:
        eventually(end.get_matched_publications)
    time.sleep(0.5)  # the server's own discovery
    assert raw.write(requests[0], encode(message_class(REQUEST)()))
    # both clients get the answer to one request, and neither can tell whose it is
    samples = [taken(end, eventually) for end in responses]
    assert {decode(RESPONSE, sample.cdr).message for sample in samples} == {"from ROS 2"}
    assert peer.count("/theirs/stop") == 1
    # the server goes on serving those of its own kind
    assert peer.call("/theirs/stop", 10.0) == "from ROS 2"

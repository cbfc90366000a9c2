"""Services over Zenoh: between our own nodes, and with an independent implementation of ROS 2."""

from __future__ import annotations

import json
import threading
from concurrent.futures import Future

import pytest
from joshua.messages import decode, encode, message_class, type_hash
from joshua.transport import TransportError
from joshua.transport.zenoh.endpoints import read_endpoint

TRIGGER = "std_srvs/srv/Trigger"
REQUEST = bytes(encode(message_class(f"{TRIGGER}_Request")()))


def response(message, success=True):
    return bytes(encode(message_class(f"{TRIGGER}_Response")(success=success, message=message)))


def test_the_hash_of_a_service_is_that_of_ros_2():
    # as the description of std_srvs in Jazzy has it
    assert type_hash(TRIGGER) == "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f"


def test_a_service_is_listed_answers_and_leaves(zenoh_spec, router, opener, eventually):
    server, near = opener(zenoh_spec), opener(zenoh_spec)
    service = server.create_node("arm", "/left").create_service(
        "/left/arm/stop", TRIGGER, lambda request: response(f"{len(request)} bytes")
    )
    node = near.create_node("caller")
    (seen,) = eventually(near.services)
    assert (seen.node, seen.name, seen.type_name) == ("/left/arm", "/left/arm/stop", TRIGGER)

    def answer():
        try:
            return node.call_service("/left/arm/stop", TRIGGER, REQUEST, 5.0)
        except TransportError:
            return None  # the queryable may become known after its token

    assert decode(f"{TRIGGER}_Response", eventually(answer)).message == f"{len(REQUEST)} bytes"
    service.close()
    eventually(lambda: near.services() == [])
    with pytest.raises(TransportError, match=r"/left/arm/stop did not answer within 0\.2 s"):
        node.call_service("/left/arm/stop", TRIGGER, REQUEST, 0.2)


def test_a_service_that_fails_says_so_and_the_next_call_is_served(zenoh_spec, router, opener):
    node = opener(zenoh_spec).create_node("one")
    answers = iter([ValueError("no such joint"), response("done")])

    def serve(request):
        answer = next(answers)
        if isinstance(answer, Exception):
            raise answer
        return answer

    node.create_service("/one/go", TRIGGER, serve)
    with pytest.raises(TransportError, match="/one/go failed: ValueError: no such joint"):
        node.call_service("/one/go", TRIGGER, REQUEST, 5.0)
    assert decode(f"{TRIGGER}_Response", node.call_service("/one/go", TRIGGER, REQUEST, 5.0)).success


def test_an_answer_may_come_later_and_keeps_no_other_waiting(zenoh_spec, router, opener):
    transport = opener(zenoh_spec)
    node, caller = transport.create_node("one"), transport.create_node("caller")
    later: Future[bytes] = Future()
    asked = threading.Event()

    def serve(request):
        if asked.is_set():
            return response("at once")
        asked.set()
        return later

    node.create_service("/one/go", TRIGGER, serve)
    said = []

    def call():
        answer = caller.call_service("/one/go", TRIGGER, REQUEST, 20.0)
        said.append(decode(f"{TRIGGER}_Response", answer).message)

    waiting = threading.Thread(target=call)
    waiting.start()
    assert asked.wait(20)
    call()
    later.set_result(response("later"))
    waiting.join()
    assert said == ["at once", "later"]


def test_an_independent_client_and_server_understand_ours(zenoh_spec, router, opener, program, eventually):
    transport = opener(zenoh_spec)
    node = transport.create_node("ours")
    kind = "std_srvs/srv/SetBool"

    def serve(request):
        got = decode(f"{kind}_Request", request).data
        return bytes(encode(message_class(f"{kind}_Response")(success=got, message="hello from joshua")))

    node.create_service("/ours/greet", kind, serve)
    port = read_endpoint(zenoh_spec.listen_endpoints[0]).port
    peer = program("sdk_services.py", port, zenoh_spec.domain_id, "/ours/greet")
    assert peer.stdout.readline() == "ready\n"
    assert json.loads(peer.stdout.readline()) == {"success": True, "message": "hello from joshua"}
    eventually(lambda: "/sdk/greet" in [item.name for item in transport.services()])
    request = bytes(encode(message_class(f"{kind}_Request")(data=True)))
    answer = node.call_service("/sdk/greet", kind, request, 10.0)
    assert decode(f"{kind}_Response", answer).message == "the sdk got True"


def test_dds_carries_no_services_and_says_so(dds_spec, opener):
    transport = opener(dds_spec)
    node = transport.create_node("one")
    assert (transport.carries_services, transport.services()) == (False, [])
    for use in (
        lambda: node.create_service("/one/go", TRIGGER, lambda request: request),
        lambda: node.call_service("/one/go", TRIGGER, REQUEST, 1.0),
    ):
        with pytest.raises(TransportError, match="the transport dds carries no services"):
            use()

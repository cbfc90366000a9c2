"""Hosting, joining and taking over the Zenoh router."""

from __future__ import annotations

import signal
import socket

import pytest
from joshua.messages import encode, message_class
from joshua.plan import QosProfile, TransportSettings
from joshua.testing.port import free_port
from joshua.testing.transport import transport_settings
from joshua.transport import TransportError, prepare_transport


def test_the_first_hosts_and_the_second_joins(zenoh_spec, router):
    assert router.hosting
    assert router.description == f"hosts the Zenoh router on {zenoh_spec.listen_endpoints[0]}"
    second = prepare_transport(zenoh_spec)
    try:
        assert not second.hosting
        assert second.description == f"joined the Zenoh router on {zenoh_spec.listen_endpoints[0]}"
    finally:
        second.close()
        second.close()


def test_a_fork_of_a_process_with_a_session_is_refused_instead_of_hanging(zenoh_spec, program):
    forked = program("fork.py", zenoh_spec.model_dump_json())
    assert "Fork before you open the transport" in forked.stdout.readline()
    assert forked.wait(60) == 0


def test_nodes_meet_across_two_routers(zenoh_spec, router, opener, eventually):
    """As on two machines: each has a router, and one connects to the other."""
    other = TransportSettings(
        listen_endpoints=(f"tcp/localhost:{free_port()}",),
        connect_endpoints=zenoh_spec.listen_endpoints,
        domain_id=zenoh_spec.domain_id,
    )
    second = prepare_transport(other)
    try:
        got = []
        far = opener(other).create_node("far")
        far.create_subscription("/topic", "std_msgs/msg/UInt8", QosProfile(), got.append)
        publisher = (
            opener(zenoh_spec)
            .create_node("near")
            .create_publisher("/topic", "std_msgs/msg/UInt8", QosProfile())
        )
        eventually(lambda: publisher.subscription_count == 1, what="the match across the routers")
        publisher.publish(encode(message_class("std_msgs/msg/UInt8")(3)))
        eventually(lambda: got)
    finally:
        second.close()


def test_dds_needs_no_router():
    assert prepare_transport(transport_settings("dds")) is None


def test_a_survivor_takes_the_place_of_a_killed_router(zenoh_spec, opener, program, eventually):
    first = program("router.py", zenoh_spec.model_dump_json())
    assert "hosts" in first.stdout.readline()
    keeper = prepare_transport(zenoh_spec)
    try:
        assert not keeper.hosting
        early = opener(zenoh_spec)
        early.create_node("early")
        first.send_signal(signal.SIGKILL)
        first.wait()
        eventually(lambda: keeper.hosting)
        late = opener(zenoh_spec)
        late.create_node("late")
        both = ["early", "late"]
        eventually(lambda: [n.name for n in late.nodes()] == both, what="the late node's view of both")
        eventually(lambda: [n.name for n in early.nodes()] == both, what="the early node's view of both")
    finally:
        keeper.close()


def test_a_port_that_something_else_holds_is_named(monkeypatch):
    monkeypatch.setattr("joshua.transport.zenoh.machine_router._ANSWER_S", 1.0)
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        endpoint = f"tcp/127.0.0.1:{other.getsockname()[1]}"
        with pytest.raises(
            TransportError,
            match=f"another program uses {endpoint} and does not answer as a Zenoh router, .*`ss -ltnp`",
        ):
            prepare_transport(TransportSettings(listen_endpoints=(endpoint,)))


@pytest.mark.parametrize(
    ("endpoint", "text"),
    [
        ("localhost:7447", "write protocol/host:port"),
        ("tcp/localhost", "write protocol/host:port"),
        ("http/localhost:80", "tcp, tls, quic"),
        ("tcp/localhost:99999", "write protocol/host:port"),
        ("tls/localhost:7447", "requires certificates"),
    ],
)
def test_endpoints_that_cannot_be_used_are_refused(endpoint, text):
    with pytest.raises(TransportError, match=text):
        prepare_transport(TransportSettings(listen_endpoints=(endpoint,)))


@pytest.mark.parametrize(
    ("endpoint", "text"),
    [
        ("tcp/192.0.2.1:7447", "no interface of this machine has that address"),
        ("tcp/robot.invalid:7447", "the host name is unknown"),
    ],
)
def test_an_address_of_another_machine_is_refused_at_once(endpoint, text):
    with pytest.raises(TransportError, match=f"the Zenoh router cannot listen on {endpoint}: {text}"):
        prepare_transport(TransportSettings(listen_endpoints=(endpoint,)))


def test_a_router_elsewhere_that_does_not_answer_is_reported_until_it_does(zenoh_spec, caplog, eventually):
    caplog.set_level("INFO")
    (endpoint,) = zenoh_spec.listen_endpoints
    near = TransportSettings(
        listen_endpoints=(f"tcp/localhost:{free_port()}",),
        connect_endpoints=("tcp/no..name:7447", endpoint),
    )
    handle = prepare_transport(near)
    try:
        eventually(lambda: len(caplog.messages) == 2, what="the warnings")
        nowhere, silent = caplog.messages
        assert "router answers on tcp/no..name:7447 (the host name no..name cannot be resolved)" in nowhere
        assert silent.startswith(f"connect_endpoints: no router answers on {endpoint}, retrying")
        far = prepare_transport(zenoh_spec)
        eventually(lambda: f"linked to the router on {endpoint}" in caplog.messages, what="the link")
        far.close()
        lost = f"lost the link to the router on {endpoint}, retrying"
        eventually(lambda: lost in caplog.messages, what="the loss")
    finally:
        handle.close()


def test_connect_endpoints_have_no_effect_where_another_program_hosts_the_router(zenoh_spec, router):
    second = prepare_transport(zenoh_spec.model_copy(update={"connect_endpoints": ("tcp/localhost:9",)}))
    try:
        assert "connect_endpoints of this file have no effect while it runs" in second.description
    finally:
        second.close()

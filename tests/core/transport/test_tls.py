"""With TLS configured only programs that hold a certificate of the authority get anything."""

from __future__ import annotations

import json

import pytest
from certificates import Authority
from joshua.messages import encode, message_class
from joshua.plan import QosProfile, TlsSpec, TransportSettings
from joshua.transport import TransportError, prepare_transport

STRING = "std_msgs/msg/String"


@pytest.fixture
def authority(tmp_path):
    return Authority(tmp_path, "robots")


@pytest.fixture
def secure(zenoh_spec, authority):
    certificate, key = authority.issue("robot")
    tls = TlsSpec(root_ca_file=authority.file, certificate_file=certificate, private_key_file=key)
    endpoint = zenoh_spec.listen_endpoints[0].replace("tcp/", "tls/")
    return zenoh_spec.model_copy(update={"listen_endpoints": (endpoint,), "tls": tls})


def test_our_nodes_talk_and_a_client_needs_a_certificate(
    secure, authority, tmp_path, opener, program, eventually
):
    handle = prepare_transport(secure)
    try:
        near, far = opener(secure), opener(secure)
        got = []
        far.create_node("listener").create_subscription("/topic", STRING, QosProfile(), got.append)
        publisher = near.create_node("talker").create_publisher("/topic", STRING, QosProfile())
        eventually(lambda: publisher.subscription_count == 1)
        message = encode(message_class(STRING)("secret"))
        publisher.publish(message)
        eventually(lambda: got)

        endpoint = secure.listen_endpoints[0]
        stranger = Authority(tmp_path, "strangers")
        guests = {
            "none": program("raw_zenoh.py", endpoint, authority.file, 5),
            "foreign": program("raw_zenoh.py", endpoint, authority.file, 5, *stranger.issue("guest")),
            "ours": program("raw_zenoh.py", endpoint, authority.file, 60, *authority.issue("friend")),
        }

        def all_reported():
            publisher.publish(message)
            return all(guest.poll() is not None for guest in guests.values())

        eventually(all_reported, timeout_s=120, what="the reports of the guests")
        reports = {name: json.loads(guest.stdout.read()) for name, guest in guests.items()}
        assert reports["none"] == {"connected": False, "heard": []}
        assert reports["foreign"] == {"connected": False, "heard": []}
        assert reports["ours"]["connected"]
        assert reports["ours"]["heard"][0].startswith(f"{secure.domain_id}/topic/")
    finally:
        handle.close()


def test_an_open_endpoint_beside_certificates_is_refused(secure):
    spec = secure.model_copy(update={"listen_endpoints": ("tcp/0.0.0.0:7447",)})
    with pytest.raises(TransportError, match="would accept clients without a certificate"):
        prepare_transport(spec)


def test_encryption_without_certificates_is_refused():
    with pytest.raises(TransportError, match="Set the tls block of the transport"):
        prepare_transport(TransportSettings(listen_endpoints=("tls/localhost:7447",)))

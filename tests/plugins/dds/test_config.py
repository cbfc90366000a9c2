"""Settings of a DDS domain: how far a process reaches, and what this machine cannot provide."""

from __future__ import annotations

import os
import re
import socket
import stat
import sys
from pathlib import Path

import pytest
from joshua.testing.transport import transport_settings
from joshua.transport import TransportError, open_transport, prepare_transport
from joshua_dds.config import domain_config, require_usable

linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        ({"network_interface": "eth99"}, "this machine has no interface 'eth99'. It has .*lo"),
        ({"peers": ("robot.invalid",)}, "peers: the host name 'robot.invalid' cannot be resolved"),
        (
            {"peers": ("192.168..20",)},
            r"peers: '192\.168\.\.20' is not a host name or address. Write an address",
        ),
        ({"peers": ("127.0.0.1", "robot.invalid:7410")}, "the host name 'robot.invalid' cannot be resolved"),
    ],
)
def test_dds_settings_that_cannot_be_used_are_named(fields: dict[str, object], text: str):
    spec = transport_settings("dds", discovery_range="SUBNET", **fields)
    for use in (open_transport, prepare_transport):
        with pytest.raises(TransportError, match=text):
            use(spec)


@pytest.mark.parametrize("peer", ["127.0.0.1", "127.0.0.1:7410", "localhost", "::1", "[::1]", "[::1]:7410"])
def test_addresses_and_names_of_peers_are_taken(peer: str):
    require_usable(transport_settings("dds", network_interface="lo", peers=(peer,)))
    require_usable(transport_settings("dds", network_interface="127.0.0.1"))


def test_a_settings_file_of_cyclone_dds_that_is_missing_is_named(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("CYCLONEDDS_URI", "<General/>,file:///nowhere/dds.xml")
    with pytest.raises(
        TransportError, match=re.escape("CYCLONEDDS_URI names /nowhere/dds.xml, which is not")
    ):
        open_transport(transport_settings("dds"))


@linux
def test_every_socket_of_dds_is_tied_to_the_loopback_device(dds_spec, opener):
    before = set(own_datagram_sockets())
    opener(dds_spec).create_node("a")
    found = {key: value for key, value in own_datagram_sockets().items() if key not in before}
    assert len(found) >= 2  # discovery and data
    for address, device in found.values():
        assert address == "127.0.0.1" or device == "lo", f"socket on {address}, device {device!r}"


def own_datagram_sockets():
    """Address and device of this process's UDP sockets, by inode."""
    found = {}
    for entry in Path("/proc/self/fd").iterdir():
        try:
            status = os.fstat(int(entry.name))
            if not stat.S_ISSOCK(status.st_mode):
                continue
            copy = os.dup(int(entry.name))
        except OSError:
            continue  # another thread has closed it meanwhile
        with socket.socket(fileno=copy) as end:
            if end.type == socket.SOCK_DGRAM and end.family == socket.AF_INET:
                device = end.getsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, 16)
                found[status.st_ino] = (end.getsockname()[0], device.rstrip(b"\0").decode())
    return found


def test_dds_settings_by_range():
    def config(**values):
        return domain_config(transport_settings("dds", **values))

    local = config()
    assert '<NetworkInterface address="127.0.0.1"/>' in local
    assert "<AllowMulticast>false</AllowMulticast>" in local
    assert '<Peers><Peer address="localhost"/></Peers>' in local
    subnet = config(discovery_range="SUBNET", network_interface="eth0", peers=("10.0.0.7",))
    assert '<NetworkInterface name="eth0"/>' in subnet
    assert "AllowMulticast" not in subnet
    assert '<Peer address="10.0.0.7"/>' in subnet
    assert "localhost" not in subnet
    assert "<Tag>ros_discovery_off_" in config(discovery_range="OFF")
    assert "Interfaces" not in config(discovery_range="SUBNET")


def test_settings_of_cyclonedds_uri_follow_ours(monkeypatch):
    monkeypatch.setenv("CYCLONEDDS_URI", "<General/>")
    assert domain_config(transport_settings("dds")).endswith("</CycloneDDS>,<General/>")


def test_an_unknown_interface_is_named_in_the_error(dds_spec):
    spec = dds_spec.model_copy(update={"network_interface": "nosuch0", "discovery_range": "SUBNET"})
    with pytest.raises(TransportError, match="network_interface"):
        open_transport(spec)


def test_one_process_has_one_configuration_of_a_domain(dds_spec, opener):
    opener(dds_spec)
    opener(dds_spec)
    with pytest.raises(TransportError, match="with other settings"):
        open_transport(dds_spec.model_copy(update={"discovery_range": "OFF"}))

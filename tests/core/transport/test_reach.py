"""How far a process reaches: its sockets, and the discovery ranges of ROS 2."""

from __future__ import annotations

import ipaddress
import os
import socket
import stat
import sys
from pathlib import Path

import pytest
from joshua.plan import TransportSpec
from joshua.transport import TransportError, open_transport
from joshua.transport.dds.config import domain_config

linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")


def listening(pid):
    """Addresses on which a process takes TCP connections or datagrams."""
    sockets = set()
    for entry in Path(f"/proc/{pid}/fd").iterdir():
        try:
            target = str(entry.readlink())
        except FileNotFoundError:
            continue
        if target.startswith("socket:["):
            sockets.add(target[8:-1])
    found = []
    for table in ("tcp", "tcp6", "udp", "udp6"):
        for line in Path(f"/proc/{pid}/net/{table}").read_text().splitlines()[1:]:
            parts = line.split()
            if parts[9] not in sockets or (table.startswith("tcp") and parts[3] != "0A"):
                continue
            raw = bytes.fromhex(parts[1].split(":")[0])
            words = [raw[index : index + 4][::-1] for index in range(0, len(raw), 4)]
            found.append((table, ipaddress.ip_address(b"".join(words))))
    return found


@linux
def test_nothing_of_zenoh_listens_beyond_loopback(zenoh_spec, program):
    process = program("stay.py", zenoh_spec.model_dump_json())
    assert process.stdout.readline() == "ready\n"
    found = listening(process.pid)
    assert len(found) >= 2  # the router and the node
    for table, address in found:
        mapped = getattr(address, "ipv4_mapped", None) or address
        assert mapped.is_loopback, f"{table} socket on {address}"


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


@linux
def test_the_router_listens_on_a_network_when_the_file_says_so(zenoh_spec, program):
    port = zenoh_spec.listen_endpoints[0].rsplit(":", 1)[1]
    opened = zenoh_spec.model_copy(update={"listen_endpoints": (f"tcp/0.0.0.0:{port}",)})
    process = program("stay.py", opened.model_dump_json())
    assert process.stdout.readline() == "ready\n"
    addresses = [address for _, address in listening(process.pid)]
    assert ipaddress.ip_address("0.0.0.0") in addresses
    # the node itself still listens on loopback only
    assert all(address.is_loopback or address.is_unspecified for address in addresses)


@pytest.mark.parametrize("kind", ["zenoh", "dds"])
def test_range_off_hides_processes_from_each_other(kind, zenoh_spec, opener, program, eventually):
    spec = zenoh_spec.model_copy(update={"kind": kind, "discovery_range": "OFF"})
    process = program("stay.py", spec.model_dump_json())
    assert process.stdout.readline() == "ready\n"
    transport = opener(spec)
    transport.create_node("alone")
    eventually(lambda: [node.name for node in transport.nodes()] == ["alone"])
    # a witness with the usual range does not see the hidden process either
    witness = program("nodes.py", spec.model_copy(update={"discovery_range": "LOCALHOST"}).model_dump_json())
    assert witness.stdout.readline() == "[]\n"


def test_dds_settings_by_range():
    def config(**values):
        return domain_config(TransportSpec(kind="dds", **values))

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
    assert domain_config(TransportSpec(kind="dds")).endswith("</CycloneDDS>,<General/>")


def test_an_unknown_interface_is_named_in_the_error(dds_spec):
    spec = dds_spec.model_copy(update={"network_interface": "nosuch0", "discovery_range": "SUBNET"})
    with pytest.raises(TransportError, match="network_interface"):
        open_transport(spec)


def test_one_process_has_one_configuration_of_a_domain(dds_spec, opener):
    opener(dds_spec)
    opener(dds_spec)
    with pytest.raises(TransportError, match="with other settings"):
        open_transport(dds_spec.model_copy(update={"discovery_range": "OFF"}))


def test_a_missing_extra_is_named(monkeypatch):
    monkeypatch.setattr("joshua.transport.dds.dds_installed", lambda: False)
    with pytest.raises(TransportError, match=r"pip install 'joshua-core\[dds\]'"):
        open_transport(TransportSpec(kind="dds"))

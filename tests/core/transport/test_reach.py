"""How far a process reaches: its sockets, and the discovery ranges of ROS 2."""

from __future__ import annotations

import ipaddress
import sys
from pathlib import Path

import pytest
from joshua.testing.transport import transport_settings

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
    spec = transport_settings(
        kind,
        domain_id=zenoh_spec.domain_id,
        listen_endpoints=zenoh_spec.listen_endpoints,
        discovery_range="OFF",
    )
    process = program("stay.py", spec.model_dump_json())
    assert process.stdout.readline() == "ready\n"
    transport = opener(spec)
    transport.create_node("alone")
    eventually(lambda: [node.name for node in transport.nodes()] == ["alone"])
    # a witness with the usual range does not see the hidden process either
    witness = program("nodes.py", spec.model_copy(update={"discovery_range": "LOCALHOST"}).model_dump_json())
    assert witness.stdout.readline() == "[]\n"

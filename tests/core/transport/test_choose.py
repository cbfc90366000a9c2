"""The choice of the transport and its reasons."""

from __future__ import annotations

import pytest
from joshua.plan import TlsSpec, TransportSpec
from joshua.transport.choose import TransportBlock, TransportChoiceError, choose_transport

RMW = "RMW_IMPLEMENTATION"
SOURCED = {"AMENT_PREFIX_PATH": "/opt/ros/jazzy", "ROS_DISTRO": "jazzy"}


@pytest.mark.parametrize(
    ("block", "environment", "has_dds", "kind", "reason"),
    [
        (TransportBlock(), {}, True, "zenoh", "the embedded default"),
        (TransportBlock("dds"), {}, True, "dds", "the file's transport block"),
        (TransportBlock("zenoh"), SOURCED, True, "zenoh", "the file's transport block"),
        (TransportBlock(), SOURCED, True, "dds", "a ROS 2 environment is sourced (jazzy)"),
        (TransportBlock(), {"ROS_DISTRO": "jazzy"}, True, "zenoh", "the embedded default"),
        (
            TransportBlock(),
            SOURCED,
            False,
            "zenoh",
            "the embedded default; the sourced ROS 2 speaks DDS, which needs joshua-core[dds]",
        ),
        *(
            (
                TransportBlock(),
                SOURCED | {"RMW_IMPLEMENTATION": name},
                True,
                kind,
                f"RMW_IMPLEMENTATION={name}",
            )
            for name, kind in (
                ("rmw_zenoh_cpp", "zenoh"),
                ("rmw_cyclonedds_cpp", "dds"),
                ("rmw_fastrtps_cpp", "dds"),
                ("rmw_connextdds", "dds"),
            )
        ),
        (
            TransportBlock("dds"),
            {"RMW_IMPLEMENTATION": "rmw_zenoh_cpp"},
            True,
            "dds",
            "the file's transport block",
        ),
    ],
)
def test_the_first_that_speaks_decides(block, environment, has_dds, kind, reason):
    spec = choose_transport(block, environment, has_dds=has_dds)
    assert (spec.kind, spec.reason) == (kind, reason)


def test_defaults_stay_on_loopback():
    assert choose_transport(TransportBlock(), {}, has_dds=True) == TransportSpec()


def test_values_of_the_block_and_of_the_environment_are_carried():
    tls = TlsSpec(root_ca_file="/a", certificate_file="/b", private_key_file="/c")
    block = TransportBlock(
        "zenoh", None, ("tls/0.0.0.0:7447",), ("tls/robot:7447",), tls, "eth0", ("192.168.1.20",)
    )
    environment = {
        "ROS_DOMAIN_ID": "42",
        "ROS_DISTRO": "Humble",
        "ROS_STATIC_PEERS": "10.0.0.1; 10.0.0.2;",
    }
    spec = choose_transport(block, environment, has_dds=True)
    assert spec.listen_endpoints == ("tls/0.0.0.0:7447",)
    assert spec.connect_endpoints == ("tls/robot:7447",)
    assert spec.tls == tls
    assert spec.domain_id == 42
    assert spec.distro == "humble"
    assert spec.peers == ("192.168.1.20", "10.0.0.1", "10.0.0.2")
    assert spec.discovery_range == "SUBNET"


def test_the_file_overrides_the_domain_of_the_environment():
    spec = choose_transport(TransportBlock(domain_id=0), {"ROS_DOMAIN_ID": "7"}, has_dds=True)
    assert spec.domain_id == 0


@pytest.mark.parametrize("text", ["233", "-1", "x", "1.5", "٣"])
def test_invalid_domains_are_refused(text):
    with pytest.raises(TransportChoiceError, match=r"ROS_DOMAIN_ID=.*whole numbers from 0 to 232"):
        choose_transport(TransportBlock(), {"ROS_DOMAIN_ID": text}, has_dds=True)


def test_an_unknown_implementation_is_refused_with_the_nearest():
    with pytest.raises(TransportChoiceError) as caught:
        choose_transport(TransportBlock(), {"RMW_IMPLEMENTATION": "rmw_zenoh"}, has_dds=True)
    assert caught.value.allowed[0] == "rmw_zenoh_cpp"
    assert caught.value.variable == "RMW_IMPLEMENTATION"
    assert "set one of them, unset it" in str(caught.value)


@pytest.mark.parametrize("text", ["OFF", "localhost", "SUBNET", "SYSTEM_DEFAULT"])
def test_discovery_ranges_are_taken_over(text):
    spec = choose_transport(TransportBlock("dds"), {"ROS_AUTOMATIC_DISCOVERY_RANGE": text}, has_dds=True)
    assert spec.discovery_range == text.upper()


def test_ranges_without_effect_are_said():
    environment = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}
    assert "opens nothing over Zenoh" in choose_transport(TransportBlock(), environment, has_dds=True).reason
    environment = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"}
    assert "no process finds another" in choose_transport(TransportBlock(), environment, has_dds=True).reason


def test_an_unknown_range_is_refused_with_the_nearest():
    with pytest.raises(TransportChoiceError, match="allowed are LOCALHOST, OFF"):
        choose_transport(TransportBlock(), {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCAL"}, has_dds=True)

"""The choice of the transport and its reasons."""

from __future__ import annotations

import pytest
from google.protobuf import text_format
from joshua.plan import QosProfile, TlsSpec, TransportSettings
from joshua.plugins import PluginRow, PluginStatus, Registry, TransportSpec, load_registry
from joshua.schema.transport_pb2 import TransportConfig
from joshua.transport.choice import TransportChoiceError, choose_transport, partial_qos, why_missing

RMW = "RMW_IMPLEMENTATION"
SOURCED = {"AMENT_PREFIX_PATH": "/opt/ros/jazzy", "ROS_DISTRO": "jazzy"}
INSTALLED = load_registry()
CORE_ALONE = load_registry(blocked=["joshua-dds"])
FILE = "the file's transport block"


def registry_of(*specs: TransportSpec) -> Registry:
    return Registry((PluginRow("acme", "acme-transport", "1.0", PluginStatus.OK, specs=specs),))


def choose(text="", environment=None, registry=INSTALLED, **options):
    block = text_format.Parse(text, TransportConfig())
    return choose_transport(block, environment or {}, lambda: registry, **options)


@pytest.mark.parametrize(
    ("block", "environment", "registry", "kind", "reason"),
    [
        ("", {}, INSTALLED, "zenoh", "the embedded default"),
        ("kind: TRANSPORT_DDS", {}, INSTALLED, "dds", FILE),
        ("kind: TRANSPORT_ZENOH", SOURCED, INSTALLED, "zenoh", FILE),
        ("", SOURCED, INSTALLED, "dds", "a ROS 2 environment is sourced (jazzy)"),
        ("", {"ROS_DISTRO": "jazzy"}, INSTALLED, "zenoh", "the embedded default"),
        (
            "",
            SOURCED,
            CORE_ALONE,
            "zenoh",
            "the embedded default; the sourced ROS 2 uses DDS, which requires joshua-core[dds]",
        ),
        *(
            ("", SOURCED | {RMW: name}, INSTALLED, kind, f"{RMW}={name}")
            for name, kind in (
                ("rmw_zenoh_cpp", "zenoh"),
                ("rmw_cyclonedds_cpp", "dds"),
                ("rmw_fastrtps_cpp", "dds"),
                ("rmw_connextdds", "dds"),
            )
        ),
        ("kind: TRANSPORT_DDS", {RMW: "rmw_zenoh_cpp"}, INSTALLED, "dds", FILE),
    ],
)
def test_the_first_setting_that_names_one_decides(block, environment, registry, kind, reason):
    settings = choose(block, environment, registry)
    assert (settings.kind, settings.reason) == (kind, reason)


def test_the_command_line_comes_before_everything_else():
    settings = choose("kind: TRANSPORT_ZENOH", {RMW: "rmw_zenoh_cpp"}, option="dds")
    assert (settings.kind, settings.reason) == ("dds", "--transport")
    with pytest.raises(TransportChoiceError, match="--transport='ddz': allowed are dds, zenoh"):
        choose(option="ddz")


def test_the_settings_carry_what_opens_the_transport():
    settings = choose("kind: TRANSPORT_DDS")
    assert settings.implementation == "joshua_dds.transport:DdsTransport"
    assert settings.prepare == "joshua_dds.config:require_usable"
    assert settings.limits == "Services and parameters are not offered over DDS: use `joshua call`"
    zenoh = INSTALLED.transports()["zenoh"]
    assert (zenoh.implementation, zenoh.prepare) == (choose().implementation, choose().prepare)


def test_a_transport_of_a_third_party_is_chosen_by_its_name():
    acme = TransportSpec(
        enum_values=("TRANSPORT_PLUGIN",),
        name="acme",
        implementation="acme.transport:Acme",
        rmw_implementations=("rmw_acme_cpp",),
    )
    registry = registry_of(acme)
    for settings in (
        choose('kind: TRANSPORT_PLUGIN plugin_kind: "acme"', {}, registry),
        choose("", {RMW: "rmw_acme_cpp"}, registry),
        choose("", {}, registry, option="acme"),
    ):
        assert (settings.kind, settings.implementation) == ("acme", "acme.transport:Acme")
    missing = choose('kind: TRANSPORT_PLUGIN plugin_kind: "acme"', {}, INSTALLED)
    assert missing.implementation == ""
    assert "acme requires a plugin that provides it" in why_missing(missing, INSTALLED)[0]


def test_a_missing_plugin_and_a_missing_library_are_named():
    settings = choose("kind: TRANSPORT_DDS", {}, CORE_ALONE)
    assert settings.implementation == ""
    message, remedy = why_missing(settings, CORE_ALONE)
    assert message.startswith(f"the transport dds was chosen ({FILE}), and TRANSPORT_DDS requires the plugin")
    assert "leave out --block-plugin dds" in message
    assert remedy.endswith("or choose TRANSPORT_ZENOH")
    lost = registry_of(
        TransportSpec(enum_values=("TRANSPORT_DDS",), implementation="a.b:C", library="no_such_library")
    )
    settings = choose("kind: TRANSPORT_DDS", {}, lost)
    assert settings.implementation == ""
    message, remedy = why_missing(settings, lost)
    assert message.endswith("but its library no_such_library is not installed")
    assert "pip install --force-reinstall acme-transport" in remedy


def test_zenoh_alone_asks_no_plugin():
    def never() -> Registry:
        raise AssertionError("the registry was loaded")

    assert choose_transport(TransportConfig(), {}, never) == TransportSettings()


def test_values_of_the_block_and_of_the_environment_are_carried():
    tls = TlsSpec(root_ca_file="/a", certificate_file="/b", private_key_file="/c")
    block = """
        kind: TRANSPORT_ZENOH listen_endpoints: "tls/0.0.0.0:7447" connect_endpoints: "tls/robot:7447"
        network_interface: "eth0" peers: "192.168.1.20"
    """
    environment = {
        "ROS_DOMAIN_ID": "42",
        "ROS_DISTRO": "Humble",
        "ROS_STATIC_PEERS": "10.0.0.1; 10.0.0.2;",
    }
    settings = choose(block, environment, tls=tls)
    assert settings.listen_endpoints == ("tls/0.0.0.0:7447",)
    assert settings.connect_endpoints == ("tls/robot:7447",)
    assert settings.tls == tls
    assert settings.domain_id == 42
    assert settings.distro == "humble"
    assert settings.peers == ("192.168.1.20", "10.0.0.1", "10.0.0.2")
    assert settings.discovery_range == "SUBNET"


def test_the_file_overrides_the_domain_of_the_environment():
    assert choose("domain_id: 0", {"ROS_DOMAIN_ID": "7"}).domain_id == 0


@pytest.mark.parametrize("text", ["233", "-1", "x", "1.5", "٣"])
def test_invalid_domains_are_refused(text):
    with pytest.raises(TransportChoiceError, match=r"ROS_DOMAIN_ID=.*whole numbers from 0 to 232"):
        choose("", {"ROS_DOMAIN_ID": text})


def test_an_unknown_implementation_is_refused_with_the_nearest():
    with pytest.raises(TransportChoiceError) as caught:
        choose("", {RMW: "rmw_zenoh"})
    assert caught.value.allowed[0] == "rmw_zenoh_cpp"
    assert caught.value.variable == RMW
    assert "Set one of them, unset it" in str(caught.value)


@pytest.mark.parametrize("text", ["OFF", "localhost", "SUBNET", "SYSTEM_DEFAULT"])
def test_discovery_ranges_are_taken_over(text):
    settings = choose("kind: TRANSPORT_DDS", {"ROS_AUTOMATIC_DISCOVERY_RANGE": text})
    assert settings.discovery_range == text.upper()


def test_ranges_without_effect_are_named():
    assert "has no effect over Zenoh" in choose("", {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}).reason
    assert "no process finds another" in choose("", {"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"}).reason


def test_an_unknown_range_is_refused_with_the_nearest():
    with pytest.raises(TransportChoiceError, match="allowed are LOCALHOST, OFF"):
        choose("", {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCAL"})


def test_notes_of_the_start_up_table():
    assert partial_qos("zenoh", QosProfile()) == ""
    assert partial_qos("dds", QosProfile(deadline_s=1)) == ""
    assert partial_qos("zenoh", QosProfile(deadline_s=1)) == (
        "deadline acts between JOSHUA nodes only: ROS 2's Zenoh middleware does not apply it"
    )
    everything = QosProfile(lifespan_s=1, lease_duration_s=1, liveliness="MANUAL_BY_TOPIC")
    assert partial_qos("zenoh", everything).startswith(
        "lifespan, lease duration, manual liveliness act between"
    )

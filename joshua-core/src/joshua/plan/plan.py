"""The plan of one run: a value that can be printed, compared and sent."""

from __future__ import annotations

from typing import Literal

from pydantic import ConfigDict

from joshua.plan.diagnostic import Diagnostic
from joshua.plan.node_spec import NodeSpec
from joshua.plan.report import Value


class TlsSpec(Value):
    """Certificate files of the transport, absolute paths."""

    root_ca_file: str
    certificate_file: str
    private_key_file: str


class TransportSettings(Value):
    """The transport of the topics, and its addresses.

    Attributes:
        kind: name of the transport, such as ``zenoh`` or ``dds``.
        reason: why it was chosen, for the start-up table.
        implementation, prepare, limits: of its ``TransportSpec``; "" if it is not installed.
        domain_id: ROS 2 domain; distro: ROS 2 distribution whose wire conventions apply.
        listen_endpoints, connect_endpoints: Zenoh router; network_interface, peers: DDS.
        discovery_range: effective value of ROS_AUTOMATIC_DISCOVERY_RANGE.
        open_to_local_users: whether every user of this machine may command, over Zenoh.
        link_folder: folder of a run for the sockets between its nodes; "" outside a run.
    """

    kind: str = "zenoh"
    reason: str = "the embedded default"
    implementation: str = "joshua.transport.zenoh.transport:ZenohTransport"
    prepare: str = "joshua.transport.zenoh.router:prepare"
    limits: str = ""
    domain_id: int = 0
    distro: str = "jazzy"
    listen_endpoints: tuple[str, ...] = ("tcp/localhost:7447",)
    connect_endpoints: tuple[str, ...] = ()
    tls: TlsSpec | None = None
    network_interface: str = ""
    peers: tuple[str, ...] = ()
    discovery_range: Literal["OFF", "LOCALHOST", "SUBNET", "SYSTEM_DEFAULT"] = "LOCALHOST"
    open_to_local_users: bool = False
    link_folder: str = ""


class Plan(Value):
    """The nodes of one run, in start order.

    Attributes:
        source: path of the configuration file; mode: ``MODE_…``; robot_id: ``general.id``.
        nodes: in start order; transport: of their topics.
        duration_s: the run shuts down cleanly after this time; None: it runs until stopped.
        verdict: the run ends with a pass/fail table of what each node measured.
        findings: warnings and notes in the start-up table.
    """

    model_config = ConfigDict(frozen=True, defer_build=True)  # nodes, whose start is waited for, need no plan

    source: str
    mode: str
    robot_id: str = ""
    robot_name: str = ""
    nodes: tuple[NodeSpec, ...] = ()
    transport: TransportSettings = TransportSettings()
    duration_s: float | None = None
    verdict: bool = False
    findings: tuple[Diagnostic, ...] = ()

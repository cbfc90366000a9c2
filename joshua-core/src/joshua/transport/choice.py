"""Selects the transport: the file's block, else the settings of ROS 2, else Zenoh.

Imports nothing heavy, and loads plugins only if another transport than Zenoh is possible.
"""

from __future__ import annotations

import difflib
import importlib.util
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Literal, cast

from joshua.plan import QosProfile, TlsSpec, TransportSettings
from joshua.plugins import TransportSpec
from joshua.schema import transport_pb2 as pb
from joshua.transport.transports import TransportError

if TYPE_CHECKING:
    from joshua.plugins import Registry

ZENOH, DDS = "zenoh", "dds"
_IMPLEMENTATIONS = {
    "rmw_zenoh_cpp": ZENOH,
    "rmw_cyclonedds_cpp": DDS,
    "rmw_fastrtps_cpp": DDS,
    "rmw_fastrtps_dynamic_cpp": DDS,
    "rmw_connextdds": DDS,
}
_RANGES = ("OFF", "LOCALHOST", "SUBNET", "SYSTEM_DEFAULT")
_MAX_DOMAIN = 232
_Range = Literal["OFF", "LOCALHOST", "SUBNET", "SYSTEM_DEFAULT"]
_AskRegistry = Callable[[], "Registry"]


class TransportChoiceError(TransportError):
    """A setting has a value that neither ROS 2 nor an installed plugin supports.

    Attributes:
        variable: name of the environment variable or option; found: its value.
        allowed: allowed values, the nearest first; remedy: what to do next.
    """

    def __init__(self, variable: str, found: str, allowed: Sequence[str], remedy: str) -> None:
        self.variable, self.found, self.remedy = variable, found, remedy
        near = difflib.get_close_matches(found, allowed, n=1, cutoff=0.3)
        self.allowed = tuple(dict.fromkeys([*near, *allowed]))
        super().__init__(f"{variable}={found!r}: allowed are {', '.join(self.allowed)}. {remedy}")


def kind_of(block: pb.TransportConfig) -> str:
    """The transport that a file names, such as ``zenoh``; "" if the environment decides."""
    if block.kind == pb.TRANSPORT_PLUGIN:
        return block.plugin_kind
    return "" if block.kind == pb.TRANSPORT_AUTO else TransportSpec.short(pb.TransportKind.Name(block.kind))


def choose_transport(
    block: pb.TransportConfig,
    environment: Mapping[str, str],
    registry: _AskRegistry,
    *,
    option: str = "",
    tls: TlsSpec | None = None,
) -> TransportSettings:
    """Choose the transport and state the reason.

    Args:
        block: block of the file, or an empty block.
        environment: environment variables.
        registry: loads the installed plugins. Called only if needed.
        option: value on the command line, such as ``dds``.
        tls: the block's certificates, as absolute paths.

    Returns:
        The settings, without ``implementation`` if no installed plugin provides the transport.

    Raises:
        TransportChoiceError: ``--transport``, ``RMW_IMPLEMENTATION``, ``ROS_DOMAIN_ID`` or
            ``ROS_AUTOMATIC_DISCOVERY_RANGE`` has an unknown value.
    """
    kind, reason = _kind(block, environment, registry, option)
    discovery, range_note = _discovery_range(block, environment, kind)
    values: dict[str, object] = {
        "kind": kind,
        "reason": reason + range_note,
        "domain_id": block.domain_id if block.HasField("domain_id") else _domain(environment),
        "distro": environment.get("ROS_DISTRO", "").strip().lower() or "jazzy",
        "connect_endpoints": tuple(block.connect_endpoints),
        "tls": tls,
        "network_interface": block.network_interface,
        "peers": (*block.peers, *_static_peers(environment)),
        "discovery_range": discovery,
        "open_to_local_users": block.open_to_local_users,
    }
    if block.listen_endpoints:
        values["listen_endpoints"] = tuple(block.listen_endpoints)
    if kind != ZENOH:
        spec = usable_transport(registry(), kind)
        values |= {name: getattr(spec, name, "") for name in ("implementation", "prepare", "limits")}
    return TransportSettings.model_validate(values)


def usable_transport(registry: Registry, kind: str) -> TransportSpec | None:
    """The installed transport of a name; None if there is none or its library is not installed."""
    spec = registry.transports().get(kind)
    return spec if spec is not None and not lacks_library(spec) else None


def lacks_library(spec: TransportSpec) -> bool:
    """Whether the library of a transport is missing, without importing it."""
    return bool(spec.library) and importlib.util.find_spec(spec.library) is None


def why_missing(settings: TransportSettings, registry: Registry) -> tuple[str, str]:
    """Why the selected transport is not usable, and what to do."""
    from joshua.plan import installing

    spec = registry.transports().get(settings.kind)
    chosen = f"the transport {settings.kind} was chosen ({settings.reason})"
    if spec is not None:
        distribution = registry.owner(spec).distribution
        remedy = f"{installing.reinstall(distribution)}, or choose TRANSPORT_ZENOH"
        return f"{chosen}, but its library {spec.library} is not installed", remedy
    value = TransportSpec.long(settings.kind)
    known = value in pb.TransportKind.DESCRIPTOR.values_by_name
    sentence = registry.missing("transport", TransportSpec, "", value if known else settings.kind)
    return f"{chosen}, and {sentence.partition(': ')[2]}", "Install that plugin, or choose TRANSPORT_ZENOH"


def partial_qos(kind: str, qos: QosProfile) -> str:
    """Settings of a profile that have an effect only between JOSHUA's nodes; "" if there are none."""
    settings = [
        name
        for name, used in (
            ("deadline", qos.deadline_s > 0),
            ("lifespan", qos.lifespan_s > 0),
            ("lease duration", qos.lease_duration_s > 0),
            ("manual liveliness", qos.liveliness == "MANUAL_BY_TOPIC"),
        )
        if used and kind == ZENOH
    ]
    verb, them = ("acts", "it") if len(settings) == 1 else ("act", "them")
    note = f"{verb} between JOSHUA nodes only: ROS 2's Zenoh middleware does not apply {them}"
    return f"{', '.join(settings)} {note}" if settings else ""


def _kind(
    block: pb.TransportConfig, environment: Mapping[str, str], registry: _AskRegistry, option: str
) -> tuple[str, str]:
    if option:
        if option not in (ZENOH, DDS) and option not in (known := registry().transports()):
            remedy = "Choose one of them, or install the plugin that provides it"
            raise TransportChoiceError(
                "--transport", option, tuple(dict.fromkeys([ZENOH, DDS, *known])), remedy
            )
        return option, "--transport"
    if kind := kind_of(block):
        return kind, "the file's transport block"
    implementation = environment.get("RMW_IMPLEMENTATION", "").strip()
    if implementation:
        return _of_implementation(implementation, registry), f"RMW_IMPLEMENTATION={implementation}"
    if environment.get("AMENT_PREFIX_PATH") and environment.get("ROS_DISTRO"):
        if usable_transport(registry(), DDS) is not None:
            return DDS, f"a ROS 2 environment is sourced ({environment['ROS_DISTRO']})"
        return ZENOH, "the embedded default; the sourced ROS 2 uses DDS, which requires joshua-core[dds]"
    return ZENOH, "the embedded default"


def _of_implementation(implementation: str, registry: _AskRegistry) -> str:
    if implementation in _IMPLEMENTATIONS:
        return _IMPLEMENTATIONS[implementation]
    brought = {
        name: kind for kind, spec in registry().transports().items() for name in spec.rmw_implementations
    }
    if implementation not in brought:
        remedy = "Set one of them, unset it, or name the kind in the file's transport block"
        raise TransportChoiceError(
            "RMW_IMPLEMENTATION", implementation, (*_IMPLEMENTATIONS, *brought), remedy
        )
    return brought[implementation]


def _domain(environment: Mapping[str, str]) -> int:
    text = environment.get("ROS_DOMAIN_ID", "").strip()
    if not text:
        return 0
    if not (text.isascii() and text.isdigit()) or int(text) > _MAX_DOMAIN:
        allowed = (f"whole numbers from 0 to {_MAX_DOMAIN}",)
        raise TransportChoiceError("ROS_DOMAIN_ID", text, allowed, "Set one, or unset it for 0")
    return int(text)


def _discovery_range(
    block: pb.TransportConfig, environment: Mapping[str, str], kind: str
) -> tuple[_Range, str]:
    text = environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "").strip().upper()
    if not text:
        # an interface in the file includes the machines on it; ROS_LOCALHOST_ONLY is Humble's setting
        opened = block.network_interface and environment.get("ROS_LOCALHOST_ONLY", "0") != "1"
        return ("SUBNET" if opened else "LOCALHOST"), ""
    if text not in _RANGES:
        remedy = "Set one of them, or unset it for LOCALHOST"
        raise TransportChoiceError("ROS_AUTOMATIC_DISCOVERY_RANGE", text, _RANGES, remedy)
    note = ""
    if text == "OFF":
        note = "; ROS_AUTOMATIC_DISCOVERY_RANGE=OFF: no process finds another one"
    elif kind == ZENOH and text != "LOCALHOST":
        note = f"; ROS_AUTOMATIC_DISCOVERY_RANGE={text} has no effect over Zenoh, use listen_endpoints"
    return cast(_Range, text), note


def _static_peers(environment: Mapping[str, str]) -> tuple[str, ...]:
    peers = environment.get("ROS_STATIC_PEERS", "").split(";")
    return tuple(peer.strip() for peer in peers if peer.strip())

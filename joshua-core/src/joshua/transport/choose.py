"""Which middleware carries the topics: the file's block, else ROS 2's own settings, else Zenoh.

Pure functions of their arguments; nothing heavy is imported.
"""

from __future__ import annotations

import difflib
import importlib.util
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, cast

from joshua.plan import TlsSpec, TransportSpec
from joshua.transport.errors import TransportError

_IMPLEMENTATIONS = {
    "rmw_zenoh_cpp": "zenoh",
    "rmw_cyclonedds_cpp": "dds",
    "rmw_fastrtps_cpp": "dds",
    "rmw_fastrtps_dynamic_cpp": "dds",
    "rmw_connextdds": "dds",
}
_RANGES = ("OFF", "LOCALHOST", "SUBNET", "SYSTEM_DEFAULT")
_MAX_DOMAIN = 232
_Range = Literal["OFF", "LOCALHOST", "SUBNET", "SYSTEM_DEFAULT"]


class TransportChoiceError(TransportError):
    """An environment variable has a value that ROS 2 does not know.

    Attributes:
        variable: its name; found: its value; allowed: what it may hold, the nearest first.
        remedy: what to do next.
    """

    def __init__(self, variable: str, found: str, allowed: tuple[str, ...], remedy: str) -> None:
        self.variable, self.found, self.allowed, self.remedy = variable, found, allowed, remedy
        super().__init__(f"{variable}={found!r}: allowed are {', '.join(allowed)}; {remedy}")


@dataclass(frozen=True)
class TransportBlock:
    """The values of a file's ``transport`` block.

    Attributes:
        kind: ``auto``, ``zenoh`` or ``dds``; domain_id: None where the file names none.
        listen_endpoints, connect_endpoints, tls: Zenoh; network_interface, peers: DDS.
    """

    kind: Literal["auto", "zenoh", "dds"] = "auto"
    domain_id: int | None = None
    listen_endpoints: tuple[str, ...] = ()
    connect_endpoints: tuple[str, ...] = ()
    tls: TlsSpec | None = None
    network_interface: str = ""
    peers: tuple[str, ...] = ()


def dds_installed() -> bool:
    """Whether the extra ``joshua-core[dds]`` is installed; imports nothing."""
    return importlib.util.find_spec("cyclonedds") is not None


def choose_transport(
    block: TransportBlock, environment: Mapping[str, str], *, has_dds: bool
) -> TransportSpec:
    """Chooses the transport and says why.

    Args:
        block: what the file says; the empty block where it says nothing.
        environment: environment variables.
        has_dds: whether the extra ``joshua-core[dds]`` is installed.

    Raises:
        TransportChoiceError: ``RMW_IMPLEMENTATION``, ``ROS_DOMAIN_ID`` or
            ``ROS_AUTOMATIC_DISCOVERY_RANGE`` holds a value that ROS 2 does not know.
    """
    kind, reason = _kind(block, environment, has_dds)
    discovery, range_note = _discovery_range(block, environment, kind)
    values: dict[str, object] = {
        "kind": kind,
        "reason": reason + range_note,
        "domain_id": block.domain_id if block.domain_id is not None else _domain(environment),
        "distro": environment.get("ROS_DISTRO", "").strip().lower() or "jazzy",
        "connect_endpoints": block.connect_endpoints,
        "tls": block.tls,
        "network_interface": block.network_interface,
        "peers": block.peers + _static_peers(environment),
        "discovery_range": discovery,
    }
    if block.listen_endpoints:
        values["listen_endpoints"] = block.listen_endpoints
    return TransportSpec.model_validate(values)


def _kind(block: TransportBlock, environment: Mapping[str, str], has_dds: bool) -> tuple[str, str]:
    if block.kind != "auto":
        return block.kind, "the file's transport block"
    implementation = environment.get("RMW_IMPLEMENTATION", "").strip()
    if implementation:
        if implementation not in _IMPLEMENTATIONS:
            near = difflib.get_close_matches(implementation, _IMPLEMENTATIONS, n=1, cutoff=0.3)
            allowed = tuple(dict.fromkeys([*near, *_IMPLEMENTATIONS]))
            remedy = "set one of them, unset it, or name the kind in the file's transport block"
            raise TransportChoiceError("RMW_IMPLEMENTATION", implementation, allowed, remedy)
        return _IMPLEMENTATIONS[implementation], f"RMW_IMPLEMENTATION={implementation}"
    if environment.get("AMENT_PREFIX_PATH") and environment.get("ROS_DISTRO"):
        distro = environment["ROS_DISTRO"]
        if has_dds:
            return "dds", f"a ROS 2 environment is sourced ({distro})"
        note = "the embedded default; the sourced ROS 2 speaks DDS, which needs joshua-core[dds]"
        return "zenoh", note
    return "zenoh", "the embedded default"


def _domain(environment: Mapping[str, str]) -> int:
    text = environment.get("ROS_DOMAIN_ID", "").strip()
    if not text:
        return 0
    if not (text.isascii() and text.isdigit()) or int(text) > _MAX_DOMAIN:
        allowed = (f"whole numbers from 0 to {_MAX_DOMAIN}",)
        raise TransportChoiceError("ROS_DOMAIN_ID", text, allowed, "set one, or unset it for 0")
    return int(text)


def _discovery_range(block: TransportBlock, environment: Mapping[str, str], kind: str) -> tuple[_Range, str]:
    text = environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "").strip().upper()
    if not text:
        # a file that names an interface means the machines on it; ROS_LOCALHOST_ONLY is Humble's switch
        opened = block.network_interface and environment.get("ROS_LOCALHOST_ONLY", "0") != "1"
        return ("SUBNET" if opened else "LOCALHOST"), ""
    if text not in _RANGES:
        near = difflib.get_close_matches(text, _RANGES, n=1, cutoff=0.3)
        allowed = tuple(dict.fromkeys([*near, *_RANGES]))
        remedy = "set one of them, or unset it for LOCALHOST"
        raise TransportChoiceError("ROS_AUTOMATIC_DISCOVERY_RANGE", text, allowed, remedy)
    note = ""
    if text == "OFF":
        note = "; ROS_AUTOMATIC_DISCOVERY_RANGE=OFF: no process finds another one"
    elif kind == "zenoh" and text != "LOCALHOST":
        note = f"; ROS_AUTOMATIC_DISCOVERY_RANGE={text} opens nothing over Zenoh, listen_endpoints does"
    return cast(_Range, text), note


def _static_peers(environment: Mapping[str, str]) -> tuple[str, ...]:
    peers = environment.get("ROS_STATIC_PEERS", "").split(";")
    return tuple(peer.strip() for peer in peers if peer.strip())

"""QoS profiles as DDS policies, and back from the discovery data of other endpoints.

Source: ros2/rmw_cyclonedds, create_readwrite_qos, and OMG DDS 1.4.
"""

from __future__ import annotations

from typing import Any

from cyclonedds.core import Policy, Qos
from cyclonedds.util import duration
from joshua.api.transports import QosProfile
from joshua.messages import distro, type_hash
from joshua.messages.typestore import HASH_UNSUPPORTED

_NS_PER_S = 1_000_000_000
_INFINITE = duration(infinite=True)

POLICY_NAMES = {2: "durability", 4: "deadline", 8: "liveliness", 11: "reliability", 23: "data representation"}
"""Names of the policies that make a pair incompatible, by the policy ids of DDS."""

XCDR1 = Policy.DataRepresentation(use_cdrv0_representation=True, use_xcdrv2_representation=False)
"""The encoding of all ROS 2 payloads."""


_IN_FRAGMENTS = frozenset(
    f"sensor_msgs/msg/{name}" for name in ("Image", "CompressedImage", "PointCloud", "PointCloud2")
)


def keeps_until_taken(qos: QosProfile, type_name: str) -> bool:
    """Return whether a writer drops its newest message, not its oldest, when a reader does not keep up.

    A writer that replaces a message of which a reader has some fragments leaves a gap. Readers of Fast DDS
    2.14 can spin on that gap indefinitely, at 100 % of a processor (tests/ros).
    """
    return type_name in _IN_FRAGMENTS and qos.reliability == "RELIABLE" and qos.history != "KEEP_ALL"


def endpoint_qos(qos: QosProfile, type_name: str, *, is_writer: bool) -> Qos:
    """Return the policies of a writer or reader."""
    depth = max(qos.depth, 1)
    kept = qos.history == "KEEP_ALL" or (is_writer and keeps_until_taken(qos, type_name))
    kept_for_late = Policy.History.KeepAll if qos.history == "KEEP_ALL" else Policy.History.KeepLast(depth)
    history = Policy.History.KeepAll if kept else kept_for_late
    # a writer that waits inside the wheel would hold the whole interpreter; the publisher waits instead
    reliable = Policy.Reliability.Reliable(0)
    lease = _ns(qos.lease_duration_s)
    manual = qos.liveliness == "MANUAL_BY_TOPIC"
    policies: list[Any] = [
        reliable if qos.reliability == "RELIABLE" else Policy.Reliability.BestEffort,
        history,
        Policy.Liveliness.ManualByTopic(lease) if manual else Policy.Liveliness.Automatic(lease),
        XCDR1,
        *user_data(type_name),
    ]
    if qos.deadline_s > 0:
        policies.append(Policy.Deadline(_ns(qos.deadline_s)))
    if is_writer and qos.lifespan_s > 0:
        policies.append(Policy.Lifespan(_ns(qos.lifespan_s)))
    if qos.durability == "TRANSIENT_LOCAL":
        policies.append(Policy.Durability.TransientLocal)
        if is_writer:
            # this policy, not the history, limits what late joiners receive
            unlimited = -1
            policies.append(Policy.DurabilityService(0, kept_for_late, *[unlimited] * 3))
    else:
        policies.append(Policy.Durability.Volatile)
    return Qos(*[policy for policy in policies if policy is not None])


def user_data(type_name: str) -> list[Any]:
    """Return the policy that carries an endpoint's type hash; none for Humble, whose wire has no hash."""
    found = type_hash(type_name)
    return [] if found == HASH_UNSUPPORTED else [Policy.Userdata(f"typehash={found};".encode())]


def read_qos(qos: Qos) -> QosProfile:
    """Return the profile of another endpoint; discovery omits its history, which stays at the default."""
    liveliness = qos[Policy.Liveliness]
    return QosProfile(
        reliability="RELIABLE" if _is(qos, Policy.Reliability, "Reliable") else "BEST_EFFORT",
        durability="VOLATILE" if _is(qos, Policy.Durability, "Volatile") else "TRANSIENT_LOCAL",
        history="KEEP_ALL" if _is(qos, Policy.History, "KeepAll") else "KEEP_LAST",
        depth=getattr(qos[Policy.History], "depth", QosProfile().depth),
        deadline_s=_seconds(qos[Policy.Deadline], "deadline"),
        lifespan_s=_seconds(qos[Policy.Lifespan], "lifespan"),
        liveliness="MANUAL_BY_TOPIC" if "ManualByTopic" in repr(liveliness) else "AUTOMATIC",
        lease_duration_s=_seconds(liveliness, "lease_duration"),
    )


def read_type_hash(qos: Qos) -> str:
    """Return the type hash in the user data of an endpoint; "" if it has none."""
    data = qos[Policy.Userdata]
    if data is None:
        return HASH_UNSUPPORTED if distro() == "humble" else ""
    for entry in bytes(data.data).split(b";"):
        key, _, value = entry.partition(b"=")
        if key == b"typehash":
            return value.decode(errors="replace")
    return HASH_UNSUPPORTED if distro() == "humble" else ""


def _is(qos: Qos, family: Any, name: str) -> bool:
    policy = qos[family]
    return policy is not None and name in repr(policy)


def _seconds(policy: Any, field: str) -> float:
    value = getattr(policy, field, _INFINITE)
    return 0.0 if value is None or value >= _INFINITE else float(value / _NS_PER_S)


def _ns(duration_s: float) -> int:
    return round(duration_s * _NS_PER_S) if duration_s > 0 else int(_INFINITE)

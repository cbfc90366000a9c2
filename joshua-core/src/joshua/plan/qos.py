"""ROS 2 quality of service as a value."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

_STRONGER = {"reliability": "RELIABLE", "durability": "TRANSIENT_LOCAL", "liveliness": "MANUAL_BY_TOPIC"}


@dataclass(frozen=True)
class QosProfile:
    """ROS 2 quality of service. The defaults are those of ROS 2.

    Durations are in seconds; 0 if not set.
    """

    reliability: Literal["RELIABLE", "BEST_EFFORT"] = "RELIABLE"
    durability: Literal["VOLATILE", "TRANSIENT_LOCAL"] = "VOLATILE"
    history: Literal["KEEP_LAST", "KEEP_ALL"] = "KEEP_LAST"
    depth: int = 10
    liveliness: Literal["AUTOMATIC", "MANUAL_BY_TOPIC"] = "AUTOMATIC"
    deadline_s: float = 0.0
    lifespan_s: float = 0.0
    lease_duration_s: float = 0.0


class QosClash(NamedTuple):
    """A setting of which a publisher offers less than a subscription requests."""

    field: str
    offered: str
    requested: str


def qos_clashes(offered: QosProfile, requested: QosProfile) -> list[QosClash]:
    """Why a publisher is incompatible with a subscription; empty if it is compatible.

    Source: OMG DDS 1.4, section 2.2.3, and the ROS 2 documentation, "QoS compatibilities".
    """
    found = [
        QosClash(field, getattr(offered, field), stronger)
        for field, stronger in _STRONGER.items()
        if getattr(requested, field) == stronger != getattr(offered, field)
    ]
    for field in ("deadline_s", "lease_duration_s"):
        offer, request = getattr(offered, field), getattr(requested, field)
        # 0 means no limit, which is the longest
        if request > 0 and not 0 < offer <= request:
            found.append(QosClash(field, f"{offer:g} s" if offer > 0 else "none", f"{request:g} s"))
    return found

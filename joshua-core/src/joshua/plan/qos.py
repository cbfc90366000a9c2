"""ROS 2 quality of service as a value."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class QosProfile:
    """ROS 2 quality of service; the defaults are the specification's (and ROS 2's).

    Durations are in seconds; 0 means that none is set.
    """

    reliability: Literal["RELIABLE", "BEST_EFFORT"] = "RELIABLE"
    durability: Literal["VOLATILE", "TRANSIENT_LOCAL"] = "VOLATILE"
    history: Literal["KEEP_LAST", "KEEP_ALL"] = "KEEP_LAST"
    depth: int = 10
    liveliness: Literal["AUTOMATIC", "MANUAL_BY_TOPIC"] = "AUTOMATIC"
    deadline_s: float = 0.0
    lifespan_s: float = 0.0
    lease_duration_s: float = 0.0

"""The time of message stamps: this computer's, or the simulation's.

It is the same for everything in a process, as in ROS 2 with ``use_sim_time``.
"""

from __future__ import annotations

import time
from typing import Any

from joshua.plan import QosProfile, TopicSpec

#: The topic of the simulation's time. By ROS 2 convention, only the newest message counts.
CLOCK = TopicSpec(
    name="/clock",
    type_name="rosgraph_msgs/msg/Clock",
    qos=QosProfile(reliability="BEST_EFFORT", depth=1),
)

_simulated_ns: int | None = None


def follow_simulation() -> None:
    """Use the simulation's time, 0 until the first one is received."""
    global _simulated_ns
    if _simulated_ns is None:
        _simulated_ns = 0


def set_simulated_ns(value_ns: int) -> None:
    """Set the simulation's time, in ns from its start. No effect unless it is followed."""
    global _simulated_ns
    if _simulated_ns is not None:
        _simulated_ns = value_ns


def take(message: Any, received_ns: int) -> None:
    """Handle a message of ``CLOCK``."""
    del received_ns
    set_simulated_ns(message.clock.sec * 1_000_000_000 + message.clock.nanosec)


def is_simulated() -> bool:
    """Whether stamps are simulated time."""
    return _simulated_ns is not None


def received_ns(system_ns: int) -> int:
    """The time of a reception on the clock of the stamps, from this computer's."""
    return system_ns if _simulated_ns is None else _simulated_ns


def now_ns() -> int:
    """The time for a stamp: ns since the epoch, or since the start of the simulation."""
    return time.time_ns() if _simulated_ns is None else _simulated_ns

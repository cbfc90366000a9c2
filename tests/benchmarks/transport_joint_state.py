"""JointState (6 joints) at 500 Hz between two processes: one-way latency of every carrier."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from _harness import main
from joshua.messages import make

CARRIERS = (
    "UNIX socket",
    "shared-memory ring",
    "plain zenoh",
    "plain cyclonedds",
    "joshua-zenoh",
    "joshua-dds",
)


class JointStates:
    """Six joints; the number travels as the first position, the time as the stamp."""

    name = "JointState, 6 joints, 500 Hz, one way"
    type_name = "sensor_msgs/msg/JointState"
    rate_hz = 500.0
    count = 2500

    def __init__(self) -> None:
        self._names = [f"joint_{index}" for index in range(6)]
        self._zeros = np.zeros(6)

    def make(self, number: int) -> Any:
        """A message that carries the number and the time of the call."""
        stamp_ns = time.monotonic_ns()
        position = np.full(6, float(number))
        return make.joint_state(self._names, position, self._zeros, self._zeros, at_ns=stamp_ns)

    def read(self, message: Any) -> tuple[int, int]:
        """(number, time in ns) of a received message."""
        return int(message.position[0]), make.stamp_ns(message.header.stamp)


if __name__ == "__main__":
    main(JointStates(), CARRIERS, {"joshua-zenoh": (150.0, 100.0), "joshua-dds": (150.0, 100.0)})

"""640 × 480 rgb8 images at 30 Hz between two processes: one-way latency and processor share."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from _harness import main
from joshua.messages import make
from transport_joint_state import CARRIERS


class Images:
    """An image of noise; the number travels in its first bytes, the time as the stamp."""

    name = "Image 640 × 480 rgb8, 30 Hz, one way"
    type_name = "sensor_msgs/msg/Image"
    rate_hz = 30.0
    count = 150

    def __init__(self) -> None:
        self._pixels = np.random.default_rng(1).integers(0, 256, (480, 640, 3), dtype=np.uint8)

    def make(self, number: int) -> Any:
        """A message that carries the number and the time of the call."""
        stamp_ns = time.monotonic_ns()
        self._pixels.reshape(-1)[:8] = np.frombuffer(number.to_bytes(8, "little", signed=True), np.uint8)
        return make.image(self._pixels, frame_id="camera", at_ns=stamp_ns)

    def read(self, message: Any) -> tuple[int, int]:
        """(number, time in ns) of a received message."""
        number = int.from_bytes(message.data[:8].tobytes(), "little", signed=True)
        return number, make.stamp_ns(message.header.stamp)


if __name__ == "__main__":
    main(Images(), CARRIERS, {"joshua-zenoh": (1000.0, 3.0), "joshua-dds": (1000.0, 3.0)})

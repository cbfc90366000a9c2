"""Node behaviours of the cadence benchmark."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from joshua.messages import message_class
from joshua.node.behaviour import NodeBehaviour


class ImageSource(NodeBehaviour):
    """Publishes 640×480 rgb8 images at the rate of its publisher."""

    def configure(self) -> None:
        """Declares publisher and timer."""
        topic = self.context.spec.publishers[0]
        image, header = message_class("sensor_msgs/msg/Image"), message_class("std_msgs/msg/Header")
        time = message_class("builtin_interfaces/msg/Time")
        self._message = image(
            header=header(stamp=time(sec=0, nanosec=0), frame_id="camera"),
            height=480,
            width=640,
            encoding="rgb8",
            is_bigendian=0,
            step=1920,
            data=np.zeros(640 * 480 * 3, dtype=np.uint8),
        )
        self._publisher = self.context.publisher(topic)
        self.context.create_timer(1.0 / topic.rate_hz, self._tick, name="image")

    def _tick(self) -> None:
        self._publisher.publish(self._message)


class ControlLoop(NodeBehaviour):
    """A 100 Hz timer that receives images beside it."""

    def configure(self) -> None:
        """Declares subscriptions and the timer."""
        self._newest: dict[str, Any] = {}
        for topic in self.context.spec.subscriptions:
            self.context.subscribe(topic, partial(self._keep, topic.name))
        self.context.create_timer(0.01, self._tick, name="control")

    def _keep(self, name: str, message: Any, _received_ns: int) -> None:
        self._newest[name] = message

    def _tick(self) -> None:
        for message in self._newest.values():
            assert message.width == 640

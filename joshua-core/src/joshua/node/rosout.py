"""A node's log records on ``/rosout``, as ROS 2 tools expect them."""

from __future__ import annotations

import threading
from typing import Any

from joshua.ipc.messages import Log
from joshua.messages import encode, message_class
from joshua.plan import NodeSpec, QosProfile
from joshua.transport import NodeHandle, Publisher

#: Profile of rclcpp's rosout publisher (``rclcpp::RosoutQoS``).
ROSOUT_QOS = QosProfile(durability="TRANSIENT_LOCAL", depth=1000, lifespan_s=10.0)

#: Levels of rcl_interfaces/msg/Log are those of ``logging``.
LEVELS = (10, 20, 30, 40, 50)


class RosoutPublisher:
    """Publishes log records; the topic is declared with the first record.

    Args:
        handle: the node in the graph.
        spec: the node's part of the plan.
    """

    def __init__(self, handle: NodeHandle, spec: NodeSpec) -> None:
        self._handle = handle
        self._name = spec.full_name.strip("/").replace("/", ".")
        self._publisher: Publisher | None = None
        self._lock = threading.Lock()
        self._busy = threading.local()

    def publish(self, log: Log) -> None:
        """Publishes one record; records that this causes in turn are left out."""
        if getattr(self._busy, "active", False):
            return
        self._busy.active = True
        try:
            with self._lock:
                if self._publisher is None:
                    self._publisher = self._handle.create_publisher(
                        "/rosout", "rcl_interfaces/msg/Log", ROSOUT_QOS
                    )
            self._publisher.publish(encode(self._message(log)))
        finally:
            self._busy.active = False

    def _message(self, log: Log) -> Any:
        seconds, nanoseconds = divmod(log.time_ns, 1_000_000_000)
        time_class = message_class("builtin_interfaces/msg/Time")
        return message_class("rcl_interfaces/msg/Log")(
            stamp=time_class(sec=seconds, nanosec=nanoseconds),
            level=max((level for level in LEVELS if level <= log.level), default=LEVELS[0]),
            name=self._name,
            msg=log.text,
            file=log.file,
            function="",
            line=log.line,
        )

"""The state of a device as rows of ``diagnostic_msgs/msg/DiagnosticArray``, once a second."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

from joshua.messages.make import header
from joshua.messages.typestore import message_class
from joshua.node import ros_time
from joshua.node.context import NodeContext
from joshua.plan import TopicSpec

#: The topic on which ROS 2 tools expect the state of every device.
TOPIC = TopicSpec(name="/diagnostics", type_name="diagnostic_msgs/msg/DiagnosticArray", rate_hz=1.0)


@dataclass(frozen=True)
class DiagnosticStatus:
    """One row; the fields are those of ``diagnostic_msgs/msg/DiagnosticStatus``.

    Attributes:
        level: ``OK``, ``WARN``, ``ERROR`` or ``STALE``.
        name: part of the device, such as a joint; "" for the whole of it.
        message: one sentence for a person; hardware_id: identity of the device.
        values: what was measured, the unit in the name: ``temperature_c``.
    """

    OK: ClassVar[int] = 0
    WARN: ClassVar[int] = 1
    ERROR: ClassVar[int] = 2
    STALE: ClassVar[int] = 3

    level: int
    name: str
    message: str
    hardware_id: str
    values: Mapping[str, str] = field(default_factory=dict)


class DiagnosticsPublisher:
    """Publishes the rows of one node on ``/diagnostics`` at 1 Hz, on the node's thread.

    Args:
        context: of the node.
        rows: returns the last readings, without input or output, so that the control loop never waits for it.
    """

    def __init__(self, context: NodeContext, rows: Callable[[], Sequence[DiagnosticStatus]]) -> None:
        self._context = context
        self._rows = rows
        self._publisher = context.publisher(TOPIC)

    def start(self) -> None:
        """Creates the timer."""
        self._context.create_timer(1 / TOPIC.rate_hz, self.publish, name="diagnostics")

    def publish(self) -> None:
        """Publishes the present rows, if any."""
        rows = self._rows()
        if rows:
            self._publisher.publish(diagnostic_array(self._context.spec.full_name, rows))


def diagnostic_array(node: str, rows: Sequence[DiagnosticStatus]) -> Any:
    """Makes the message. By ROS 2 convention, the names of the rows begin with that of the node."""
    status = message_class("diagnostic_msgs/msg/DiagnosticStatus")
    pair = message_class("diagnostic_msgs/msg/KeyValue")
    messages = [
        status(
            row.level,
            f"{node.lstrip('/')}: {row.name}" if row.name else node.lstrip("/"),
            row.message,
            row.hardware_id,
            [pair(key, value) for key, value in row.values.items()],
        )
        for row in rows
    ]
    return message_class("diagnostic_msgs/msg/DiagnosticArray")(header(at_ns=ros_time.now_ns()), messages)

"""Simulated time, published on ``/clock`` and set directly for the nodes of this process."""

from __future__ import annotations

from typing import Any

from joshua.api import NodeContext
from joshua.api.clocks import ros_time
from joshua.api.nodes import TopicSpec
from joshua.messages import message_class

from joshua_mujoco_sim.physics import Physics
from joshua_mujoco_sim.world import World

#: Publishing period of the clock, in simulated time.
PERIOD_S = 0.01

CLOCK = TopicSpec(name="/clock", type_name="rosgraph_msgs/msg/Clock", rate_hz=1 / PERIOD_S)


class ClockPublisher:
    """The time of a world, set in this process and published.

    Args:
        world: whose time; context: of the node that publishes.
        publishes: if False, only set the time of this process.
    """

    def __init__(self, world: World, context: NodeContext, *, publishes: bool = True) -> None:
        self._publisher = context.publisher(CLOCK) if publishes else None
        self._published_s = -PERIOD_S
        self._unhook = world.after_step(self._tick, first=True)  # later stamps use the new time

    def close(self) -> None:
        """Stop the clock."""
        self._unhook()

    def _tick(self, physics: Physics) -> None:
        time_s = physics.time_s
        ros_time.set_simulated_ns(round(time_s * 1e9))
        if time_s < self._published_s or time_s - self._published_s >= PERIOD_S - 1e-9:
            self._published_s = time_s
            if self._publisher is not None:
                self._publisher.publish(clock_message(time_s))


def clock_message(time_s: float) -> Any:
    """Return a ``rosgraph_msgs/msg/Clock``."""
    total_ns = round(time_s * 1e9)
    stamp = message_class("builtin_interfaces/msg/Time")(*divmod(total_ns, 1_000_000_000))
    return message_class("rosgraph_msgs/msg/Clock")(clock=stamp)

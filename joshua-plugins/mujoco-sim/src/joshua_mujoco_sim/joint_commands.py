"""Positions that anybody sends to the simulation: ``~/joint_commands``."""

from __future__ import annotations

from difflib import get_close_matches
from typing import Any

import numpy as np
from joshua.api import NodeContext, TopicSpec

from joshua_mujoco_sim.physics import Physics
from joshua_mujoco_sim.world import World

JOINT_STATE = "sensor_msgs/msg/JointState"


class Commands:
    """Drives the actuators of the model to the positions of messages, joints by name.

    Args:
        world: the physics.
        context: of the node, for the subscription and the log.
    """

    def __init__(self, world: World, context: NodeContext) -> None:
        self._world = world
        self._context = context
        with world.lock:
            self._group = world.physics.group(())
        self._goal = np.full(len(self._group), np.nan)
        self._warned: set[str] = set()
        self._unhook = world.before_step(self._drive)

    def subscribe(self) -> None:
        """Subscribes to the topic."""
        spec = TopicSpec(name="~/joint_commands", type_name=JOINT_STATE)
        self._context.subscribe(spec, self._take)

    def close(self) -> None:
        """Lets the actuators go."""
        self._unhook()

    def _take(self, message: Any, received_ns: int) -> None:
        """Reads a message (transport thread); what is unknown or no number is named and left out."""
        del received_ns
        goal = self._goal.copy()
        for name, value in zip(message.name, message.position, strict=False):
            if name not in self._group.joints:
                near = get_close_matches(name, self._group.joints, n=1)
                nearest = f"did you mean {near[0]}? " if near else ""
                self._warn(f"no joint {name!r}; {nearest}the model has {', '.join(self._group.joints)}")
            elif not np.isfinite(value):
                self._warn(f"{name} is {value}; a position in radians is a finite number")
            else:
                index = self._group.joints.index(name)
                goal[index] = np.clip(
                    value, self._group.range_min_rad[index], self._group.range_max_rad[index]
                )
        with self._world.lock:
            self._goal = goal

    def _drive(self, physics: Physics) -> None:
        del physics
        known = np.isfinite(self._goal)
        if known.any():
            self._group.set_command(np.where(known, self._goal, self._group.command))

    def _warn(self, text: str) -> None:
        if text not in self._warned:
            self._warned.add(text)
            self._context.log.warning("~/joint_commands: %s", text)

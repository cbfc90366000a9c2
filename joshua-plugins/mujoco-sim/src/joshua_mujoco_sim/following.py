"""Joints of the model that follow topics: MIRROR copies a robot's positions, INTERACTIVE drives joints."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from difflib import get_close_matches
from typing import Any

import numpy as np
from joshua.api import NodeContext
from joshua.api.nodes import TopicSpec

from joshua_mujoco_sim.actuator_group import ActuatorGroup
from joshua_mujoco_sim.physics import Physics
from joshua_mujoco_sim.settings_parts import TopicMapping
from joshua_mujoco_sim.world import World

JOINT_STATE = "sensor_msgs/msg/JointState"

#: Distance beyond a joint's range up to which a command is not reported: rounding.
LIMIT_TOLERANCE_RAD = 0.01

#: Number of lags that are kept for the report.
LAGS_KEPT = 100_000


class Following(ABC):
    """Moves some actuators of the model to goals from messages, before each step.

    Args:
        world: the physics; context: of the node, for subscriptions and the log; actuators: () for all.
    """

    def __init__(self, world: World, context: NodeContext, actuators: Sequence[str] = ()) -> None:
        self._world = world
        self._context = context
        with world.lock:
            self._group: ActuatorGroup = world.physics.group(actuators)
        self._goal = np.full(len(self._group), np.nan)
        self._warned: set[str] = set()
        self._unhook = world.before_step(self._move)

    def close(self) -> None:
        """Stop following."""
        self._unhook()

    @abstractmethod
    def _move(self, physics: Physics) -> None:
        """Move the joints that have a goal (before each step and under the lock)."""

    def _warn(self, topic: str, text: str) -> None:
        if f"{topic}{text}" not in self._warned:
            self._warned.add(f"{topic}{text}")
            self._context.log.warning("%s %s", topic, text)


class Mirror(Following):
    """Copies joint positions from messages to the model.

    The joints are placed, not driven: the twin shows where the robot is, whatever the gains of the model.
    Everything else in the model, such as an object on the table, moves by physics.

    Args:
        world: the physics; mappings: which joint of which topic moves which actuator.
        context: of the node, for subscriptions and the log.
    """

    def __init__(self, world: World, mappings: Sequence[TopicMapping], context: NodeContext) -> None:
        self._mappings = tuple(mappings)
        self._arrived_ns = 0
        self._lags_s: list[float] = []
        super().__init__(world, context, [mapping.mujoco_actuator for mapping in self._mappings])

    def subscribe(self) -> None:
        """Subscribe to each topic once, with the quality of service that the plan gives it."""
        planned = {topic.name: topic for topic in self._context.spec.subscriptions}
        for topic in dict.fromkeys(mapping.ros_topic for mapping in self._mappings):
            name = topic if topic.startswith(("/", "~")) else f"/{topic}"
            rows = [
                (index, mapping) for index, mapping in enumerate(self._mappings) if mapping.ros_topic == topic
            ]
            spec = planned.get(name) or TopicSpec(name=name, type_name=JOINT_STATE)
            self._context.subscribe(spec, self._handler(rows))

    def report(self) -> str:
        """Return the lag from message to model state in one sentence."""
        if not self._lags_s:
            return "mirror: no message received; start the robot, and check its topics with joshua topic list"
        lags_ms = 1000 * np.array(self._lags_s)
        return (
            f"mirror: {len(lags_ms)} messages, from arrival to state "
            f"p50 {np.percentile(lags_ms, 50):.2f} ms, p99 {np.percentile(lags_ms, 99):.2f} ms"
        )

    def _handler(self, rows: list[tuple[int, TopicMapping]]) -> Callable[[Any, int], None]:
        def take(message: Any, received_ns: int) -> None:
            del received_ns  # lag on the monotonic clock
            self._take(message, rows)

        return take

    def _take(self, message: Any, rows: list[tuple[int, TopicMapping]]) -> None:
        """Read the joints of a message (transport thread)."""
        names = list(message.name)
        values = self._goal.copy()
        for index, mapping in rows:
            wanted = mapping.joint or mapping.mujoco_actuator
            try:
                value = float(message.position[names.index(wanted)])
            except (ValueError, IndexError):
                near = get_close_matches(wanted, names, n=1)
                self._warn(
                    mapping.ros_topic,
                    f"has no joint {wanted!r}; {f'did you mean {near[0]}? ' if near else ''}it has "
                    f"{', '.join(names) or 'none'}; name the right one in mirror_topic_mappings.joint",
                )
                continue
            if not np.isfinite(value):
                self._warn(mapping.ros_topic, f"says {value} for {wanted!r}; the joint is not moved")
                continue
            values[index] = mapping.scale * value + mapping.offset
        with self._world.lock:
            self._goal = values
            self._arrived_ns = self._arrived_ns or time.monotonic_ns()
            if self._world.paused:
                self._move(self._world.physics)

    def _move(self, physics: Physics) -> None:
        """Set the joints to the positions of the last messages."""
        del physics
        known = np.isfinite(self._goal)
        if not known.any():
            return
        position = np.where(known, self._goal, self._group.position_rad)
        self._group.set_position(position)
        self._group.set_command(position)
        if self._arrived_ns:
            if len(self._lags_s) < LAGS_KEPT:
                self._lags_s.append((time.monotonic_ns() - self._arrived_ns) * 1e-9)
            self._arrived_ns = 0


class Commands(Following):
    """Drives all actuators of the model to positions received on ``~/joint_commands``."""

    def subscribe(self) -> None:
        """Subscribe to the topic."""
        spec = TopicSpec(name="~/joint_commands", type_name=JOINT_STATE)
        self._context.subscribe(spec, self._take)

    def _take(self, message: Any, received_ns: int) -> None:
        """Read a message (transport thread); unknown joints and non-finite values are logged and skipped."""
        del received_ns
        goal = self._goal.copy()
        for name, value in zip(message.name, message.position, strict=False):
            index = self._group.place_of(name)
            if index is None:
                near = get_close_matches(name, self._group.joints, n=1)
                nearest = f"did you mean {near[0]}? " if near else ""
                self._warn(
                    "~/joint_commands:",
                    f"no joint {name!r}; {nearest}the model has {', '.join(self._group.joints)}",
                )
            elif not np.isfinite(value):
                self._warn("~/joint_commands:", f"{name} is {value}; a position is a finite number")
            else:
                goal[index] = self._within_range(index, value)
        with self._world.lock:
            self._goal = goal

    def _within_range(self, index: int, value_rad: float) -> float:
        """Return the nearest position within the joint's range, and warn once of one outside."""
        low, high = float(self._group.range_min_rad[index]), float(self._group.range_max_rad[index])
        nearest = min(max(value_rad, low), high)
        if abs(value_rad - nearest) > LIMIT_TOLERANCE_RAD:
            self._warn(
                "~/joint_commands:",
                f"a command for {self._group.joints[index]} is outside its range of {low:.4g} to {high:.4g} "
                f"{self._group.units[index]}; the joint stays within its range",
            )
        return nearest

    def _move(self, physics: Physics) -> None:
        del physics
        known = np.isfinite(self._goal)
        if known.any():
            self._group.set_command(self._goal)

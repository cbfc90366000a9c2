"""PASSIVE: a recording moves the model; exceeded limits and collisions are reported."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from joshua_mujoco_sim.actuator_group import ActuatorGroup
from joshua_mujoco_sim.physics import Physics
from joshua_mujoco_sim.trajectories.trajectory import FloatArray, Trajectory

#: Tolerance of joint limits, because recordings are rounded.
LIMIT_TOLERANCE_RAD = 0.005

#: Penetration depth up to which a contact is not a collision.
DEPTH_TOLERANCE_M = 0.001


@dataclass(frozen=True)
class Breach:
    """A motion of a recording that the robot could not execute.

    Attributes:
        time_s: start, in the recording; text: description.
    """

    time_s: float
    text: str


class Replay:
    """Moves the model to each sample of the recordings, and checks it.

    Args:
        physics: the model, moved only by the replay.
        trajectories: played in order.
        speed: how many times faster than recorded; 0 for as fast as possible.

    Raises:
        TrajectoryError: a recording does not fit the model.

    Attributes:
        breaches: exceeded limits and collisions, each at its start.
        samples: number of placed samples.
    """

    def __init__(self, physics: Physics, trajectories: Sequence[Trajectory], speed: float) -> None:
        self._physics = physics
        self._group = physics.group(())
        self._speed = speed
        ranges = self._group.ranges_rad
        self._parts = [(trajectory, *trajectory.for_joints(ranges)) for trajectory in trajectories]
        self._part = self._sample = 0
        self._clock_s = 0.0
        self._broken: set[str] = set()
        self.breaches: list[Breach] = []
        self.samples = 0

    @property
    def done(self) -> bool:
        """Whether every sample was placed."""
        return self._part >= len(self._parts)

    @property
    def group(self) -> ActuatorGroup:
        """Driven joints."""
        return self._group

    def advance(self, elapsed_s: float, *, most: int = 2000) -> None:
        """Place every sample that is due.

        Args:
            elapsed_s: wall time since the last call.
            most: largest number of samples in one call, which bounds its duration.
        """
        self._clock_s += elapsed_s * self._speed
        for _ in range(most):
            if self.done:
                return
            trajectory, joints, position = self._parts[self._part]
            time_s = float(trajectory.time_s[self._sample])
            if self._speed > 0 and time_s > self._clock_s:
                return
            self._place(trajectory, time_s, joints, position[self._sample])
            self._sample += 1
            if self._sample == len(position):
                self._part, self._sample = self._part + 1, 0
                self._clock_s = 0.0

    def report(self) -> str:
        """Return the result of the replay in one sentence."""
        limits = sum(breach.text.startswith("limit") for breach in self.breaches)
        collisions = len(self.breaches) - limits
        text = f"replayed {self.samples} samples of {len(self._parts)} recording(s)"
        if not self.breaches:
            return f"{text}: within the limits, without a collision"
        return f"{text}: {limits} exceeded limit(s), {collisions} collision(s)"

    def _place(
        self, trajectory: Trajectory, time_s: float, joints: tuple[str, ...], values: FloatArray
    ) -> None:
        physics, group = self._physics, self._group
        position = group.position_rad
        for joint, value in zip(joints, values, strict=True):
            position[group.joints.index(joint)] = value
        group.set_position(position)
        group.set_command(position)
        mujoco.mj_forward(physics.model, physics.data)
        physics.data.time = time_s
        self.samples += 1
        present = {**self._over_limits(position), **self._collisions()}
        source = f"{trajectory.source}, {time_s:.2f} s"
        self.breaches += [
            Breach(time_s, f"{text} ({source})") for key, text in present.items() if key not in self._broken
        ]
        self._broken = set(present)

    def _over_limits(self, position: FloatArray) -> dict[str, str]:
        group = self._group
        over = np.maximum(group.range_min_rad - position, position - group.range_max_rad)
        found = {}
        for index in np.flatnonzero(over > LIMIT_TOLERANCE_RAD):
            joint, low, high = group.joints[index], group.range_min_rad[index], group.range_max_rad[index]
            found[f"limit {joint}"] = (
                f"limit exceeded: {joint} at {position[index]:+.3f} {group.units[index]}, allowed {low:+.3f} "
                f"to {high:+.3f}"
            )
        return found

    def _collisions(self) -> dict[str, str]:
        data = self._physics.data
        found: dict[str, str] = {}
        for number in range(data.ncon):
            contact = data.contact[number]
            if contact.dist < -DEPTH_TOLERANCE_M:
                first, second = sorted((self._name(contact.geom1), self._name(contact.geom2)))
                text = f"collision: {first} with {second}, {-1000 * contact.dist:.1f} mm deep"
                found.setdefault(f"collision {first} {second}", text)
        return found

    def _name(self, geom: int) -> str:
        """Return the body name of a shape; shapes of the fixed world have their own name."""
        model = self._physics.model
        body = int(model.geom_bodyid[geom])
        return str(model.body(body).name if body else model.geom(geom).name or "the world")

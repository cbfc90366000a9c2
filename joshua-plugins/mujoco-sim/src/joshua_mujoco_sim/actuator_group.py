"""Some joints of a model in a given order: their positions, and the commands of their actuators."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from joshua_mujoco_sim.coordinates import Coordinates
from joshua_mujoco_sim.drives import UNLIMITED_FORCE, Drives

if TYPE_CHECKING:
    from joshua_mujoco_sim.physics import Physics
    from joshua_mujoco_sim.position_loop import Gains

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]


class ActuatorGroup:
    """A group of joints of a model, in a given order, with the actuators that drive them.

    Positions, goals and limits are in radians, or in metres for slides and some tendons, whatever the model's
    controls are.

    Args:
        physics: of the model.
        names: of joints, tendons or actuators; () for every joint that can be driven.

    Raises:
        ModelError: a name is unknown, or means what cannot be driven, or a joint named before.

    Attributes:
        names: as given; joints: names of the joints; units: ``rad`` or ``m`` of each.
        kinds: what the drives of each joint take: ``position``, ``velocity`` or ``torque``.
        range_min_rad, range_max_rad: limits of the joints, shape (N,); infinite where a joint has none.
    """

    def __init__(self, physics: Physics, names: Sequence[str]) -> None:
        chosen = physics.drivable_joints(names)
        self._places = {name: place for place, joint in enumerate(chosen) for name in joint.names}
        self.joints = tuple(joint.name for joint in chosen)
        self.names = tuple(names) or self.joints
        self.units = tuple(joint.unit for joint in chosen)
        self.kinds = tuple(joint.kind for joint in chosen)
        self._physics = physics
        self._coordinates = Coordinates(physics.model, physics.data, chosen)
        self._drives = Drives(physics.model, physics.data, chosen)
        places = [physics.loop_places.get(joint.name, -1) for joint in chosen]
        self._looped: BoolArray = np.array([place >= 0 for place in places], np.bool_)
        self._loop_places: IntArray = np.array([place for place in places if place >= 0], np.int64)
        self._has_loop = bool(self._looped.any())
        low = [joint.low if joint.limited else -np.inf for joint in chosen]
        high = [joint.high if joint.limited else np.inf for joint in chosen]
        self.range_min_rad: FloatArray = np.array(low, np.float64)
        self.range_max_rad: FloatArray = np.array(high, np.float64)

    def __len__(self) -> int:
        return len(self.joints)

    def place_of(self, name: str) -> int | None:
        """Return the place of the joint that a name means; None if it means none of the group."""
        return self._places.get(name)

    @property
    def ranges_rad(self) -> dict[str, tuple[float, float]]:
        """Return lower and upper limit of each joint by name; infinite if it has none."""
        ends = zip(self.range_min_rad.tolist(), self.range_max_rad.tolist(), strict=True)
        return dict(zip(self.joints, ends, strict=True))

    @property
    def middle_rad(self) -> FloatArray:
        """Middles of the joints' ranges, shape (N,); 0 for a joint without limits."""
        middle = (self.range_min_rad + self.range_max_rad) / 2
        return np.where(np.isfinite(middle), middle, 0.0)

    @property
    def position_rad(self) -> FloatArray:
        """Positions of the joints, shape (N,), a copy."""
        return self._coordinates.position()

    @property
    def degrees_of_freedom(self) -> IntArray:
        """Indices of the joints among the model's degrees of freedom, shape (N,)."""
        return self._coordinates.dof

    @property
    def velocity_rad_s(self) -> FloatArray:
        """Speeds of the joints, shape (N,), a copy."""
        return self._coordinates.velocity()

    @property
    def torque(self) -> FloatArray:
        """Forces of the actuators on the joints, N·m or N, shape (N,), a copy."""
        return self._drives.force(self.position_rad)

    @property
    def force_limit(self) -> FloatArray:
        """Largest forces of the actuators on the joints, N·m or N, shape (N,); infinite without a limit."""
        limit = self._drives.force_limit(self.position_rad)
        return np.where(limit < UNLIMITED_FORCE, limit, np.inf)

    @property
    def stall_force(self) -> FloatArray:
        """Stall forces of the actuators at the joints, N·m or N, shape (N,)."""
        return self._drives.scale(self.position_rad, self._physics.stall_forces)

    @property
    def command(self) -> FloatArray:
        """Goals of the joints, shape (N,), a copy; the present position of a joint without one."""
        goals = self._drives.goals()
        if self._has_loop:
            goals[self._looped] = self._physics.loop.goals(self._loop_places)
        return np.where(np.isfinite(goals), goals, self.position_rad)

    def set_command(self, goals: FloatArray) -> None:
        """Drive the joints to goals, shape (N,), within the model's limits; NaN leaves one as it is."""
        if not self._has_loop:
            self._drives.go_to(goals)
            return
        self._drives.go_to(np.where(self._looped, np.nan, goals))
        places, wanted = self._loop_places, goals[self._looped]
        known = np.isfinite(wanted)
        self._physics.loop.set_goals(places[known], wanted[known])

    def let_go(self) -> None:
        """Let the drives apply no force in the next step."""
        self._end_loop()
        self._drives.let_go(self.position_rad, self.velocity_rad_s)

    def brake(self) -> None:
        """Let position and velocity drives brake the joints where they are, and others apply no force."""
        self.let_go()
        self._drives.go_to(np.where(self._looped, np.nan, self.position_rad))
        self._drives.rest(np.array([kind == "velocity" for kind in self.kinds], np.bool_))

    def set_gains(self, place: int, gains: Gains) -> None:
        """Replace the gains of a joint that a position loop drives, by its place in the group."""
        in_loop = int(self._looped[:place].sum())
        self._physics.loop.set_gains(int(self._loop_places[in_loop]), gains)

    def set_force_limit(self, limits: FloatArray) -> None:
        """Replace the force limits of the actuators by limits on the joints, N·m or N, shape (N,)."""
        self._drives.set_force_limit(limits, self.position_rad)

    def set_position(self, values: FloatArray) -> None:
        """Set the joint positions at rest, shape (N,). Call ``mj_forward`` when all is set."""
        self._coordinates.set_position(values)

    def _end_loop(self) -> None:
        if self._has_loop:
            self._physics.loop.set_goals(self._loop_places, np.full(len(self._loop_places), np.nan))

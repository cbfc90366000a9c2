"""Goals for position drives that are too soft for the loads of their joints.

A position drive of a model is a spring: under a load, its joint comes to rest away from its goal. A small droop is
the character of a servo and stays. What is beyond it, the goal of the drive makes up for, unless the joint touches
something, which a stronger drive would squeeze.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import mujoco
import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from joshua_mujoco_sim.actuator_group import ActuatorGroup
    from joshua_mujoco_sim.physics import Physics

FloatArray = npt.NDArray[np.float64]

#: Largest droop that stays, as a share of the range.
DROOP_SHARE = 0.03

#: A joint that is slower for this time is at rest, in ranges per second.
REST_SHARE_PER_S, REST_S = 0.2, 0.2

#: Time constant of the approach to the goal.
TRIM_S = 0.3

#: A contact counts from this share of the force of the drive on.
CONTACT_SHARE = 0.05

_CONTACTS = (
    mujoco.mjtConstraint.mjCNSTR_CONTACT_FRICTIONLESS,
    mujoco.mjtConstraint.mjCNSTR_CONTACT_PYRAMIDAL,
    mujoco.mjtConstraint.mjCNSTR_CONTACT_ELLIPTIC,
)


class SoftDrives:
    """Shifts the goals of the position drives of a group.

    Args:
        physics: of the model; group: whose goals these are.
    """

    def __init__(self, physics: Physics, group: ActuatorGroup) -> None:
        self._physics, self._group = physics, group
        span = group.range_max_rad - group.range_min_rad
        shifts = np.array([kind == "position" for kind in group.kinds], np.bool_) & np.isfinite(span)
        self._span: FloatArray = np.where(shifts, span, np.inf)
        self._shift: FloatArray = np.zeros(len(group))
        self._rested_s: FloatArray = np.zeros(len(group))

    def reset(self) -> None:
        """Forget the shifts, as after a release."""
        self._shift[:] = 0.0
        self._rested_s[:] = 0.0

    def shifted(self, goals: FloatArray) -> FloatArray:
        """Return the goals of the drives for goals of the joints, shape (N,), once in each step."""
        group = self._group
        error = goals - group.position_rad
        droop = DROOP_SHARE * self._span
        beyond = np.sign(error) * np.maximum(np.abs(error) - droop, 0.0)
        step_s = self._physics.timestep_s
        rests = np.abs(group.velocity_rad_s) < REST_SHARE_PER_S * self._span
        self._rested_s = np.where(rests, self._rested_s + step_s, 0.0)
        trims = (beyond != 0.0) & (self._rested_s > REST_S) & np.isfinite(self._span)
        if trims.any():
            trims &= ~self._touching()
            self._shift += np.where(trims, step_s / TRIM_S * beyond, 0.0)
            np.clip(self._shift, -self._span, self._span, out=self._shift)
        return np.asarray(goals + self._shift)

    def _touching(self) -> npt.NDArray[np.bool_]:
        """Return which joints a contact pushes, shape (N,)."""
        model, data, group = self._physics.model, self._physics.data, self._group
        forces = np.where(np.isin(data.efc_type, _CONTACTS), data.efc_force, 0.0)
        pushed = np.zeros(model.nv)
        if forces.size:
            mujoco.mj_mulJacTVec(model, data, pushed, forces)
        return np.asarray(np.abs(group.along(pushed)) > CONTACT_SHARE * np.abs(group.torque))

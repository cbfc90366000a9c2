"""What becomes of joints that hold because commands stopped and do not come back."""

from __future__ import annotations

from typing import Any

import numpy as np

from joshua.devices.actuator import FloatArray
from joshua.devices.goal import GoalGenerator, GoalState

PARK = "PARK_THEN_RELEASE"

#: A joint this close to its park pose has arrived; about what gravity takes from a servo of a desk arm.
ARRIVED_RAD = 0.05


class StalePolicy:
    """The policy of one actuator that does not hold for ever.

    Args:
        goals: of the actuator; they park it.
        values: ``action`` (``RELEASE`` or ``PARK_THEN_RELEASE``), ``after_s`` (how long the joints hold),
            ``pose_rad`` and ``timeout_s`` of a park.
    """

    def __init__(self, goals: GoalGenerator, values: dict[str, Any]) -> None:
        self._goals = goals
        self._action: str = values["action"]
        self._after_s = float(values["after_s"])
        self._pose = np.array(values["pose_rad"], np.float64)
        self._timeout_s = float(values["timeout_s"])
        self._state = GoalState.WAITING
        self._since_s = 0.0

    def look(self, position_rad: FloatArray, now_s: float) -> str:
        """Takes the state of a control cycle; returns why the torque must go now, "" while it need not."""
        state = self._goals.state if self._goals.stale else GoalState.FOLLOWING
        if state is not self._state:
            self._state, self._since_s = state, now_s
        elapsed_s = now_s - self._since_s
        if state is GoalState.HOLDING and elapsed_s >= self._after_s:
            if self._action != PARK:
                return f"no command came back within {self._after_s:g} s, so the torque was taken off"
            self._goals.park(self._pose)
        if state is GoalState.PARKING:
            if np.abs(position_rad - self._goals.reachable(self._pose)).max() < ARRIVED_RAD:
                return "no command came back, so the joints were parked and their torque was taken off"
            if elapsed_s >= self._timeout_s:
                return (
                    "no command came back, so the torque was taken off; the park pose was not reached within "
                    f"{self._timeout_s:g} s"
                )
        return ""

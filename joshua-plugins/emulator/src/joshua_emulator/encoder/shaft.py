"""The shaft that emulated encoders sit on."""

from __future__ import annotations

import math
from dataclasses import dataclass

#: Slow enough for every encoder, fast enough to pass its zero within seconds.
_SWING_RAD = 9.0
_PERIOD_S = 12.0


@dataclass
class Shaft:
    """A shaft whose angle is known at every time of the monotonic clock.

    Attributes:
        start_s: when it stood at 0; held_rad: where a fault holds it fast, None where none does.
    """

    start_s: float
    held_rad: float | None = None

    def angle_rad(self, now_s: float) -> float:
        """Its angle, counter-clockwise, over any number of turns."""
        if self.held_rad is not None:
            return self.held_rad
        return _SWING_RAD * math.sin(math.tau * (now_s - self.start_s) / _PERIOD_S)

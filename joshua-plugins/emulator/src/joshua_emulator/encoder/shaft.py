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
        start_s: when it stood at 0, or would have without the times at which it was held fast.
        held_s: since when a fault holds it fast; None if none does.
    """

    start_s: float
    held_s: float | None = None

    def hold(self, now_s: float) -> None:
        """Hold it fast where it is."""
        self.held_s = now_s if self.held_s is None else min(now_s, self.held_s)

    def release(self, now_s: float, for_s: float | None = None) -> None:
        """Let it go on from where it is; where ``for_s`` says so, for that time only."""
        if self.held_s is not None:
            self.start_s += max(0.0, now_s - self.held_s)
        self.held_s = None if for_s is None else now_s + for_s

    def angle_rad(self, now_s: float) -> float:
        """Its angle, counter-clockwise, over any number of turns."""
        if self.held_s is not None:
            now_s = min(now_s, self.held_s)
        return _SWING_RAD * math.sin(math.tau * (now_s - self.start_s) / _PERIOD_S)

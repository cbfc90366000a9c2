"""The shaft of emulated encoders."""

from __future__ import annotations

import math
from dataclasses import dataclass

#: Slow enough for every encoder, fast enough to pass its zero within seconds.
_SWING_RAD = 9.0
_PERIOD_S = 12.0


@dataclass
class Shaft:
    """A shaft with a known angle at every monotonic time.

    Attributes:
        start_s: when it stood at 0, or would have without the times at which it was held fast.
        held_s: since when a fault holds it fast; None if none does.
    """

    start_s: float
    held_s: float | None = None

    def hold(self, now_s: float) -> None:
        """Block it at its present angle."""
        self.held_s = now_s if self.held_s is None else min(now_s, self.held_s)

    def release(self, now_s: float, for_s: float | None = None) -> None:
        """Let it continue from its present angle, for ``for_s`` only if given."""
        if self.held_s is not None:
            self.start_s += max(0.0, now_s - self.held_s)
        self.held_s = None if for_s is None else now_s + for_s

    def angle_rad(self, now_s: float) -> float:
        """Return its multi-turn angle, counter-clockwise."""
        if self.held_s is not None:
            now_s = min(now_s, self.held_s)
        return _SWING_RAD * math.sin(math.tau * (now_s - self.start_s) / _PERIOD_S)

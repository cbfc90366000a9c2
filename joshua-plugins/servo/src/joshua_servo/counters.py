"""Counters of a servo bus."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass
class BusCounters:
    """Counters of the bus since it was opened. ``lost`` counts by servo id."""

    requests: int = 0
    retries: int = 0
    corrupt: int = 0
    stale: int = 0
    lost: dict[int, int] = field(default_factory=dict)

    def lose(self, servo_id: int) -> None:
        """Count a missing reply."""
        self.lost[servo_id] = self.lost.get(servo_id, 0) + 1

"""How much of recordings is read, so that a huge one ends with a message, not with the machine's memory."""

from __future__ import annotations

from pathlib import Path

from joshua_mujoco_sim.trajectories.trajectory import TrajectoryError

#: Numbers in memory at once, samples times columns: eight hours of six joints at 100 Hz, 160 MB.
MOST_NUMBERS = 20_000_000

#: Characters of one sample in a text file.
LONGEST_LINE = 1 << 20


class Budget:
    """What is left of the numbers that one replay may hold."""

    def __init__(self) -> None:
        self._most = self._left = MOST_NUMBERS

    def take(self, source: str | Path, count: int) -> None:
        """Counts numbers that are about to be kept. Raises TrajectoryError."""
        self._left -= count
        if self._left < 0:
            raise TrajectoryError(
                f"{source} is too long to be replayed at once: more than {self._most} numbers (samples times "
                "columns): cut it into parts, keep fewer samples a second, or name fewer episodes"
            )

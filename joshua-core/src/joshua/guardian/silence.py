"""Judges a driver's silence: a hang, or a machine that gives nobody its time."""

from __future__ import annotations

from joshua.guardian.driver_process import DriverProcess

#: Pause of the guardian's own loop.
TICK_S = 0.06

#: A pause counts as silence up to this multiple of the tick: beyond it the whole machine stood still.
STALL_FACTOR = 1.5

#: Silence beyond this multiple of the limit counts whatever the reason.
PATIENCE_FACTOR = 5.0

NS_PER_S = 1e9


class SilenceWatch:
    """Adds up the silence that the guardian itself has witnessed.

    Args:
        driver: for its share of the processor.
        limit_s: silence that counts as a hang.
    """

    def __init__(self, driver: DriverProcess, limit_s: float) -> None:
        self._driver = driver
        self._limit_s = limit_s
        self._last_s = 0.0
        self._heard_s = 0.0
        self._silent_s = 0.0
        self._processor = driver.processor_ns()

    def heard(self, now_s: float) -> None:
        """A sign of life came."""
        self._last_s = self._heard_s = now_s
        self._silent_s = 0.0
        self._processor = self._driver.processor_ns()

    def patience_s(self) -> float:
        """How long to listen before the next look."""
        return max(0.001, min(TICK_S, self._limit_s - self._silent_s))

    def hung(self, now_s: float) -> bool:
        """Whether the silence counts as a hang; call it after each pause."""
        self._silent_s += min(now_s - self._last_s, TICK_S * STALL_FACTOR)
        self._last_s = now_s
        if self._silent_s < self._limit_s:
            return False
        if now_s - self._heard_s >= self._limit_s * PATIENCE_FACTOR:
            return True
        return self._silent_s - self._starved_s(now_s) >= self._limit_s

    def _starved_s(self, now_s: float) -> float:
        """Part of the silence in which the driver wanted to run and could not."""
        before, after = self._processor, self._driver.processor_ns()
        if before is None or after is None:
            return 0.0
        if self._driver.is_runnable() and before[0] == after[0]:
            return now_s - self._heard_s  # it still waits, which the kernel adds up only afterwards
        return (after[1] - before[1]) / NS_PER_S

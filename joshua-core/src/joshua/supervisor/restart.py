"""Whether and when a failed process starts again: exponential back-off with a limit."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class RestartLimits:
    """Limits of the restart policy.

    Attributes:
        first_delay_s: before the first restart. Each further delay is ``factor`` times as long, up to
            ``max_delay_s``.
        failures: this many within ``window_s`` end the attempts.
    """

    first_delay_s: float = 0.5
    factor: float = 2.0
    max_delay_s: float = 10.0
    failures: int = 8
    window_s: float = 120.0


class RestartPolicy:
    """Decides after each failure of one process.

    Args:
        policies: of its nodes, ``on-failure``, ``never`` or ``stop-run``; the strictest one counts.
        limits: of ``on-failure``.
    """

    def __init__(self, policies: list[str], limits: RestartLimits) -> None:
        self.policy = min(policies, key=["stop-run", "never", "on-failure"].index)
        self._limits = limits
        self._failures_s: list[float] = []

    @property
    def stops_run(self) -> bool:
        """Whether a failure stops the whole run."""
        return self.policy == "stop-run"

    def forget(self) -> None:
        """Resets the count of failures."""
        self._failures_s = []

    def failed(self, now_s: float) -> float | str:
        """Counts a failure and returns the delay of the restart, or why there is none."""
        if self.policy != "on-failure":
            return f"its restart policy is {self.policy!r}"
        limits = self._limits
        self._failures_s = [time_s for time_s in self._failures_s if now_s - time_s < limits.window_s]
        self._failures_s.append(now_s)
        count = len(self._failures_s)
        if count >= limits.failures:
            return f"it failed {count} times within {limits.window_s:g} s"
        return float(min(limits.first_delay_s * limits.factor ** (count - 1), limits.max_delay_s))

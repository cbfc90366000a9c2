"""Whether and when a failed node starts again: back-off with a limit."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class RestartLimits:
    """Numbers of the restart policy.

    Attributes:
        first_delay_s: before the first restart; each further one waits ``factor`` times as long, up to
            ``max_delay_s``.
        failures: this many within ``window_s`` end the attempts.
    """

    first_delay_s: float = 0.5
    factor: float = 2.0
    max_delay_s: float = 10.0
    failures: int = 8
    window_s: float = 120.0


@dataclass(frozen=True)
class RestartDecision:
    """What to do after a failure.

    Attributes:
        delay_s: wait before the restart; None means that there is none.
        reason: why there is none.
    """

    delay_s: float | None
    reason: str = ""


class RestartPolicy:
    """Decides after each failure of one process.

    Args:
        policy: ``on-failure``, ``never`` or ``stop-run``, as in ``NodeSpec.restart``.
        limits: the numbers.
    """

    def __init__(self, policy: str, limits: RestartLimits) -> None:
        self.policy = policy
        self._limits = limits
        self._failures_s: list[float] = []

    @property
    def stops_run(self) -> bool:
        """Whether a failure ends the whole run."""
        return self.policy == "stop-run"

    def forget(self) -> None:
        """Counts anew: somebody has looked at the device."""
        self._failures_s = []

    def failed(self, now_s: float) -> RestartDecision:
        """Counts a failure and decides."""
        if self.policy != "on-failure":
            return RestartDecision(None, f"its restart policy is {self.policy!r}")
        limits = self._limits
        self._failures_s = [time_s for time_s in self._failures_s if now_s - time_s < limits.window_s]
        self._failures_s.append(now_s)
        count = len(self._failures_s)
        if count >= limits.failures:
            return RestartDecision(None, f"it failed {count} times within {limits.window_s:g} s")
        delay_s = limits.first_delay_s * limits.factor ** (count - 1)
        return RestartDecision(min(delay_s, limits.max_delay_s))


def strictest(policies: list[str]) -> str:
    """The policy of a process whose nodes have different ones: the one that tolerates least."""
    return min(policies, key=["stop-run", "never", "on-failure"].index)

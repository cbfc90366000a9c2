"""Settings of a run: how its processes start, stop (request, SIGTERM, SIGKILL) and restart (back-off)."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path

from joshua.ipc.run_bases import base_directory
from joshua.plan import NodeKind, NodeSpec
from joshua.supervisor.log_files import log_directory
from joshua.supervisor.reactor import Reactor, ReactorTimer


class Rung(Enum):
    """One step of the ladder."""

    REQUEST = "stop request"
    TERMINATE = "SIGTERM"
    KILL = "SIGKILL"


@dataclass(frozen=True)
class LadderTimes:
    """Time of each rung: from the stop request to SIGTERM, and from SIGTERM to SIGKILL."""

    request_s: float = 3.0
    terminate_s: float = 1.0


#: For a hung process: it gets the request, and little time.
HANG_TIMES = LadderTimes(request_s=0.3, terminate_s=0.2)


class StopLadder:
    """Climbs the rungs for one process until that has ended.

    Args:
        reactor: for the times.
        times: of the rungs.
        act: performs a rung; gets the rung and the seconds since the first one.
    """

    def __init__(self, reactor: Reactor, times: LadderTimes, act: Callable[[Rung, float], None]) -> None:
        self._reactor = reactor
        self._times = times
        self._act = act
        self._timer: ReactorTimer | None = None
        self._began_s = 0.0
        self.rung: Rung | None = None

    @property
    def begun(self) -> bool:
        """Whether the first rung was taken."""
        return self.rung is not None

    def begin(self, times: LadderTimes | None = None) -> None:
        """Takes the first rung. Idempotent."""
        if not self.begun:
            self._times = times or self._times
            self._began_s = self._reactor.now_s()
            self._take(Rung.REQUEST)

    def kill(self) -> None:
        """Jumps to the last rung."""
        if not self.begun:
            self._began_s = self._reactor.now_s()
        if self.rung is not Rung.KILL:
            self._take(Rung.KILL)

    def ended(self) -> None:
        """Takes no further rung, because the process has ended."""
        if self._timer is not None:
            self._timer.cancel()

    def _take(self, rung: Rung) -> None:
        self.ended()
        self.rung = rung
        if rung is Rung.REQUEST:
            self._timer = self._reactor.call_later(self._times.request_s, lambda: self._take(Rung.TERMINATE))
        elif rung is Rung.TERMINATE:
            self._timer = self._reactor.call_later(self._times.terminate_s, self.kill)
        self._act(rung, self._reactor.now_s() - self._began_s)


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
        self._given_up = ""

    @property
    def stops_run(self) -> bool:
        """Whether a failure stops the whole run."""
        return self.policy == "stop-run"

    def forget(self) -> None:
        """Resets the count of failures."""
        self._failures_s = []
        self._given_up = ""

    def give_up(self, reason: str) -> None:
        """Lets the process stay down after its failure, until ``forget``."""
        self._given_up = reason

    def failed(self, now_s: float) -> float | str:
        """Counts a failure and returns the delay of the restart, or why there is none."""
        if self.policy != "on-failure":
            return f"its restart policy is {self.policy!r}"
        if self._given_up:
            return self._given_up
        limits = self._limits
        self._failures_s = [time_s for time_s in self._failures_s if now_s - time_s < limits.window_s]
        self._failures_s.append(now_s)
        count = len(self._failures_s)
        if count >= limits.failures:
            return f"it failed {count} times within {limits.window_s:g} s"
        return float(min(limits.first_delay_s * limits.factor ** (count - 1), limits.max_delay_s))


#: Timeout of each half of a node's start (to configured, to active), by kind.
READY_TIMEOUT_S: dict[NodeKind, float] = {
    NodeKind.ACTUATOR: 20.0,
    NodeKind.SENSOR: 20.0,
    NodeKind.SERVICE: 120.0,
    NodeKind.MODEL: 300.0,
}


@dataclass(frozen=True)
class SupervisorOptions:
    """Settings of a run.

    Attributes:
        log_level: minimum level that nodes report, as in ``logging``.
        duration_s: length of the run after its start-up, which may take as long. None takes the plan's,
            without a limit for the start.
        start_timeout_s: limit of the start instead of ``duration_s``, and the least time that each node gets.
        heartbeat_s: interval of the heartbeats.
        status_period_s: interval of the live status.
        ladder: times of the stop ladder; ``stop_timeout_s`` of a node's facts overrides the first.
        restart: limits of the restart policy.
        run_base: folder of the run directories; log_directory: folder of the log files.
        began_s: monotonic start of the start-up time; None takes the call of ``run``.
        devices_outlive_run: false for emulated devices, whose torque ends with them.
        plan_options: words of the command line that change what the file says.
        handle_signals: whether SIGINT, SIGTERM and SIGHUP stop the run (main thread only).
    """

    log_level: int = 20
    duration_s: float | None = None
    start_timeout_s: float | None = None
    heartbeat_s: float = 0.05
    status_period_s: float = 1.0
    ladder: LadderTimes = field(default_factory=LadderTimes)
    restart: RestartLimits = field(default_factory=RestartLimits)
    run_base: Path = field(default_factory=lambda: base_directory(os.environ))
    log_directory: Path = field(default_factory=lambda: log_directory(os.environ))
    began_s: float | None = None
    devices_outlive_run: bool = True
    plan_options: tuple[str, ...] = ()
    handle_signals: bool = True


def ready_timeout_s(spec: NodeSpec) -> float:
    """Start timeout of a node: ``ready_timeout_s`` of its facts, or that of its kind."""
    return spec.facts.ready_timeout_s or READY_TIMEOUT_S[spec.kind]


def ladder_times(specs: tuple[NodeSpec, ...], default: LadderTimes) -> LadderTimes:
    """Ladder of a process. A node that parks first, for example, takes more time."""
    wanted = [spec.facts.stop_timeout_s for spec in specs]
    return LadderTimes(max([default.request_s, *wanted]), default.terminate_s)

"""Settings of the supervisor, each with its documented default."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path

from joshua.ipc.run_bases import base_directory
from joshua.plan import NodeKind, NodeSpec
from joshua.supervisor.log_files import log_directory
from joshua.supervisor.policies import LadderTimes, RestartLimits

#: Timeout of each half of a node's start (to configured, to active), by kind.
READY_TIMEOUT_S: dict[NodeKind, float] = {
    NodeKind.ACTUATOR: 20.0,
    NodeKind.SENSOR: 20.0,
    NodeKind.SERVICE: 120.0,
    NodeKind.MODEL: 300.0,
}


#: Time that every start gets, however short the run is to be.
LEAST_START_S = 20.0


@dataclass(frozen=True)
class SupervisorOptions:
    """Settings of a run.

    Attributes:
        log_level: minimum level that nodes report, as in ``logging``.
        duration_s: length of the run after its start-up, which may take as long (at least ``LEAST_START_S``).
            None takes the plan's, without a limit for the start.
        heartbeat_s: interval of the heartbeats.
        status_period_s: interval of the live status.
        ladder: times of the stop ladder; ``stop_timeout_s`` of a node's facts overrides the first.
        restart: limits of the restart policy.
        run_base: folder of the run directories; log_directory: folder of the log files.
        began_s: monotonic start of the start-up time; None takes the call of ``run``.
        handle_signals: whether SIGINT, SIGTERM and SIGHUP stop the run (main thread only).
    """

    log_level: int = 20
    duration_s: float | None = None
    heartbeat_s: float = 0.05
    status_period_s: float = 1.0
    ladder: LadderTimes = field(default_factory=LadderTimes)
    restart: RestartLimits = field(default_factory=RestartLimits)
    run_base: Path = field(default_factory=lambda: base_directory(os.environ))
    log_directory: Path = field(default_factory=lambda: log_directory(os.environ))
    began_s: float | None = None
    handle_signals: bool = True


def ready_timeout_s(spec: NodeSpec) -> float:
    """Start timeout of a node: ``ready_timeout_s`` of its facts, or that of its kind."""
    return spec.facts.ready_timeout_s or READY_TIMEOUT_S[spec.kind]


def ladder_times(specs: tuple[NodeSpec, ...], default: LadderTimes) -> LadderTimes:
    """Ladder of a process. A node that parks first, for example, takes more time."""
    wanted = [spec.facts.stop_timeout_s for spec in specs]
    return LadderTimes(max([default.request_s, *wanted]), default.terminate_s)

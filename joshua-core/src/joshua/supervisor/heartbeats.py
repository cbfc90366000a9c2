"""Heartbeats of the nodes of one process and of their threads."""

from __future__ import annotations

import time
from collections.abc import Callable

from joshua.guardian.order import HANG_LIMIT_S
from joshua.guardian.silence import WATCHER_LOOK_S, AwakeClock, SilenceJudge, ThreadTime
from joshua.ipc.messages import Heartbeat
from joshua.plan import NodeKind, NodeSpec

#: Time without a heartbeat that counts as a hang, after activation. A model may compute for seconds.
HANG_AFTER_S: dict[NodeKind, float] = {
    NodeKind.ACTUATOR: HANG_LIMIT_S,
    NodeKind.SENSOR: 2.0,
    NodeKind.SERVICE: 5.0,
    NodeKind.MODEL: 20.0,
}

#: Interval of the checks.
CHECK_PERIOD_S = 0.05


def hang_limit_s(spec: NodeSpec) -> float:
    """Limit of a node: ``hang_after_s`` of its facts, or that of its kind."""
    limit_s = spec.facts.hang_after_s
    return limit_s if limit_s > 0 else HANG_AFTER_S[spec.kind]


class HeartbeatWatch:
    """Watches the nodes of one process, each after its activation.

    Args:
        loop: returns the times of a thread of the process, 0 for its main thread.
        clock: monotonic seconds.
    """

    def __init__(
        self, loop: Callable[[int], ThreadTime | None], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._loop = loop
        self._clock = AwakeClock(clock, WATCHER_LOOK_S)
        self._judges: dict[str, SilenceJudge] = {}
        self._beats: dict[str, Heartbeat] = {}

    @property
    def active(self) -> bool:
        """Whether any node is watched."""
        return bool(self._judges)

    def begin(self, spec: NodeSpec) -> None:
        """Starts to watch a node."""
        name = spec.full_name
        self._beats.pop(name, None)

        def loop() -> ThreadTime | None:
            return self._loop(self._beats[name].thread_id if name in self._beats else 0)

        self._judges[name] = SilenceJudge(hang_limit_s(spec), self._clock, loop)

    def drop(self, node: str) -> None:
        """Stops watching a node."""
        self._judges.pop(node, None)

    def hear(self, beat: Heartbeat) -> None:
        """Notes a heartbeat."""
        if beat.node in self._judges:
            self._beats[beat.node] = beat
            self._judges[beat.node].heard()

    def end(self) -> None:
        """Stops watching."""
        self._judges.clear()

    def hung(self) -> tuple[str, str] | None:
        """Returns (node, evidence) of a hang, or None. Call every ``CHECK_PERIOD_S``."""
        for node, judge in self._judges.items():
            if judge.hung():
                text = f"its loop has not run for {judge.silence_s():.2f} s (limit {judge.limit_s:g} s)"
                return node, text
            for thread in self._beats[node].threads if node in self._beats else ():
                if thread.age_s > thread.limit_s:
                    text = f"its thread {thread.name!r} has not run for {thread.age_s:.1f} s"
                    return node, f"{text} (limit {thread.limit_s:g} s)"
        return None

"""The signs of life of the nodes of one process, and of their threads."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

from joshua.guardian.silence import WATCHER_LOOK_S, AwakeClock, SilenceJudge, ThreadTime
from joshua.ipc.messages import Heartbeat
from joshua.plan import NodeKind, NodeSpec

#: Silence of a node's loop that counts as a hang, after its activation. A model may think for long.
HANG_AFTER_S: dict[NodeKind, float] = {
    NodeKind.ACTUATOR: 0.2,
    NodeKind.SENSOR: 2.0,
    NodeKind.SERVICE: 5.0,
    NodeKind.MODEL: 20.0,
}

#: Distance of two looks at the heartbeats.
CHECK_PERIOD_S = 0.05


def hang_limit_s(spec: NodeSpec) -> float:
    """Limit of a node: ``hang_after_s`` of its facts, else the one of its kind."""
    limit_s = spec.facts.hang_after_s
    return limit_s if limit_s > 0 else HANG_AFTER_S[spec.kind]


@dataclass
class _Pulse:
    judge: SilenceJudge
    thread_id: int = 0
    threads: dict[str, tuple[float, float]] = field(default_factory=dict)


class HeartbeatWatch:
    """Watches the nodes of one process, each from its activation on.

    Args:
        loop: returns the times of a thread of the process, 0 for its main thread.
        clock: seconds that never run backwards.
    """

    def __init__(
        self, loop: Callable[[int], ThreadTime | None], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._loop = loop
        self._clock = AwakeClock(clock, WATCHER_LOOK_S)
        self._pulses: dict[str, _Pulse] = {}

    @property
    def active(self) -> bool:
        """Whether any node is watched."""
        return bool(self._pulses)

    def begin(self, spec: NodeSpec) -> None:
        """Watches a node from now on."""
        name = spec.full_name

        def loop() -> ThreadTime | None:
            pulse = self._pulses.get(name)
            return self._loop(pulse.thread_id if pulse is not None else 0)

        self._pulses[name] = _Pulse(SilenceJudge(hang_limit_s(spec), self._clock, loop))

    def drop(self, node: str) -> None:
        """Watches a node no more."""
        self._pulses.pop(node, None)

    def hear(self, beat: Heartbeat) -> None:
        """Takes a heartbeat."""
        pulse = self._pulses.get(beat.node)
        if pulse is not None:
            pulse.thread_id = beat.thread_id
            pulse.threads = {thread.name: (thread.age_s, thread.limit_s) for thread in beat.threads}
            pulse.judge.heard()

    def end(self) -> None:
        """Watches nothing any more."""
        self._pulses.clear()

    def hung(self) -> tuple[str, str] | None:
        """Returns (node, what shows that it hangs), or None; ask every ``CHECK_PERIOD_S``."""
        for node, pulse in self._pulses.items():
            judge = pulse.judge
            if judge.hung():
                text = f"its loop has not turned for {judge.silence_s():.2f} s (limit {judge.limit_s:g} s)"
                return node, text
            for name, (age_s, limit_s) in pulse.threads.items():
                if age_s > limit_s:
                    return (
                        node,
                        f"its thread {name!r} has shown no sign of life for {age_s:.1f} s "
                        f"(limit {limit_s:g} s)",
                    )
        return None

"""Silence that counts as a hang, and silence that only means a busy machine."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

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

#: A look that comes this much late says that this program itself was held up, by a stop signal for example.
HELD_UP_S = 0.1

#: A process is starved if its threads waited for a processor at least this share of a silence …
STARVED_SHARE = 0.3
#: … while the loop's own thread ran for less than this; a heartbeat costs a fraction of it.
STARVED_RAN_S = 0.01
#: Even a starved process counts as hung after this many times its limit.
STARVED_PATIENCE = 10.0


@dataclass(frozen=True)
class ProcessorTime:
    """What a node got so far.

    Attributes:
        loop_ran_s: seconds that its loop ran; loop_waited_s: that its loop waited for a processor.
        waited_s: seconds that all threads of its process waited for a processor.
        loop_is_runnable: its loop runs or waits for a processor just now.
        ready: every thread that does so, with the nanoseconds that it ran: one that is there again with the
            same number has waited all the time, which the kernel adds up only afterwards.
    """

    loop_ran_s: float
    waited_s: float
    loop_waited_s: float = 0.0
    loop_is_runnable: bool = False
    ready: frozenset[tuple[str, int]] = frozenset()


def processor_time(process_id: int, thread_id: int) -> ProcessorTime | None:
    """Reads the times of a process and its loop's thread; None where the system does not tell.

    Source: Documentation/scheduler/sched-stats.rst, first two fields of ``schedstat``, in ns.
    """
    ran_ns = waited_ns = loop_waited_ns = 0
    runnable = False
    ready = set()
    found = False
    try:
        paths = list(Path(f"/proc/{process_id}/task").glob("*/schedstat"))
    except OSError:
        return None
    for path in paths:
        try:
            fields = path.read_text().split()
            ran, waited = int(fields[0]), int(fields[1])
            is_ready = path.with_name("stat").read_text().rpartition(")")[2].split()[0] == "R"
        except (OSError, ValueError, IndexError):
            continue  # the thread has just ended
        found = True
        waited_ns += waited
        if is_ready:
            ready.add((path.parent.name, ran))
        if path.parent.name == str(thread_id):
            ran_ns, loop_waited_ns, runnable = ran, waited, is_ready
    if not found:
        return None
    return ProcessorTime(ran_ns / 1e9, waited_ns / 1e9, loop_waited_ns / 1e9, runnable, frozenset(ready))


def hang_limit_s(spec: NodeSpec) -> float:
    """Limit of a node: ``hang_after_s`` of its context, else the one of its kind."""
    limit = spec.context.get("hang_after_s")
    return float(limit) if isinstance(limit, (int, float)) and limit > 0 else HANG_AFTER_S[spec.kind]


@dataclass
class _Pulse:
    limit_s: float
    heard_s: float
    thread_id: int = 0
    threads: dict[str, tuple[float, float]] = field(default_factory=dict)
    sample: ProcessorTime | None = None
    sampled_s: float = 0.0


class HeartbeatWatch:
    """Watches the nodes of one process, each from its activation on.

    Args:
        usage: returns the processor times of the process so far, given the thread of a node's loop.
    """

    def __init__(self, usage: Callable[[int], ProcessorTime | None]) -> None:
        self._usage = usage
        self._pulses: dict[str, _Pulse] = {}

    @property
    def active(self) -> bool:
        """Whether any node is watched."""
        return bool(self._pulses)

    def begin(self, spec: NodeSpec, now_s: float) -> None:
        """Watches a node from now on."""
        self._pulses[spec.full_name] = _Pulse(hang_limit_s(spec), now_s)

    def drop(self, node: str) -> None:
        """Watches a node no more."""
        self._pulses.pop(node, None)

    def hear(self, beat: Heartbeat) -> None:
        """Takes a heartbeat; its stamp is of the clock that ``hung`` is asked with."""
        pulse = self._pulses.get(beat.node)
        if pulse is not None:
            pulse.heard_s = max(pulse.heard_s, beat.stamp_ns / 1e9)
            pulse.thread_id = beat.thread_id
            pulse.threads = {thread.name: (thread.age_s, thread.limit_s) for thread in beat.threads}
            pulse.sample = None

    def excuse(self, seconds: float, now_s: float) -> None:
        """Takes a time off every silence, in which this program could not listen."""
        for pulse in self._pulses.values():
            pulse.heard_s = min(now_s, pulse.heard_s + seconds)
            pulse.sample = None

    def end(self) -> None:
        """Watches nothing any more."""
        self._pulses.clear()

    def hung(self, now_s: float) -> tuple[str, str] | None:
        """Returns (node, what shows that it hangs), or None; ask every ``CHECK_PERIOD_S``."""
        for node, pulse in self._pulses.items():
            silence_s = now_s - pulse.heard_s
            if silence_s > pulse.limit_s / 2 and pulse.sample is None:
                pulse.sample, pulse.sampled_s = self._usage(pulse.thread_id), now_s
            if silence_s > pulse.limit_s and not self._starved(pulse, now_s):
                return node, f"its loop has not turned for {silence_s:.2f} s (limit {pulse.limit_s:g} s)"
            for name, (age_s, limit_s) in pulse.threads.items():
                if age_s > limit_s:
                    return (
                        node,
                        f"its thread {name!r} has shown no sign of life for {age_s:.1f} s "
                        f"(limit {limit_s:g} s)",
                    )
        return None

    def _starved(self, pulse: _Pulse, now_s: float) -> bool:
        """Whether the machine is to blame: the process wanted a processor and hardly got one."""
        if now_s - pulse.heard_s > STARVED_PATIENCE * pulse.limit_s:
            return False
        then, now = pulse.sample, self._usage(pulse.thread_id)
        if then is None or now is None:
            return False
        if now.loop_is_runnable and now.loop_ran_s == then.loop_ran_s:
            return True  # it still waits, which the kernel adds up only afterwards
        if now_s - pulse.heard_s - (now.loop_waited_s - then.loop_waited_s) <= pulse.limit_s:
            return True  # without those waits it would have been in time
        if now.loop_ran_s - then.loop_ran_s > STARVED_RAN_S:
            return False
        if then.ready & now.ready:  # another thread waits, which may hold the interpreter that the loop needs
            return True
        return now.waited_s - then.waited_s > STARVED_SHARE * (now_s - pulse.sampled_s)

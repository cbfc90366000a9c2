"""The report of a run: figures and results of every node, as values."""

from __future__ import annotations

from collections.abc import Iterable

from pydantic import BaseModel, ConfigDict

#: A topic on which nothing was published is silent from this number of due messages on.
SILENT_MESSAGES = 3


class Value(BaseModel):
    """A value of the plan or of a report: immutable, JSON."""

    model_config = ConfigDict(frozen=True)


class TimerReport(Value):
    """Figures of one timer. Jitter is the deviation of a tick from its time on the monotonic clock."""

    name: str
    period_s: float
    achieved_hz: float
    jitter_p50_s: float
    jitter_p99_s: float
    jitter_p999_s: float
    ticks: int
    overruns: int
    jitter_max_s: float = 0.0


class TopicReport(Value):
    """Traffic of one endpoint. ``configured_hz`` is 0 for a subscription.

    Jitter is the deviation of a publisher's intervals from its configured period; 0 if none is configured.
    """

    name: str
    type_name: str
    is_publisher: bool
    count: int
    rate_hz: float
    configured_hz: float = 0.0
    jitter_p50_s: float = 0.0
    jitter_p99_s: float = 0.0
    jitter_p999_s: float = 0.0


class CheckResult(Value):
    """One line of the pass/fail table of MODE_TEST: the check, its result and the measurement."""

    check: str
    passed: bool
    measured: str = ""


class JointTrace(Value):
    """The motion of one joint during a test. All series except the temperature have one value per time.

    Attributes:
        time_s: since the first sample.
        goal_rad: written goal, None if nothing commanded the joint; position_rad: the next reading.
        effort: as in the joint state, a fraction of stall torque or N·m.
        temperature_c: pairs of time and temperature, about one per second; empty if not measured.
    """

    joint: str
    time_s: tuple[float, ...]
    goal_rad: tuple[float | None, ...]
    position_rad: tuple[float, ...]
    effort: tuple[float, ...]
    temperature_c: tuple[tuple[float, float], ...] = ()


class NodeReport(Value):
    """One node's share of a run.

    Attributes:
        full_name: fully qualified node name.
        state: ``ready`` while it runs, at the end ``stopped`` (cleanly), ``failed`` or ``killed``.
        reason: why it failed; "" if it did not.
        restarts: number of restarts; last_failure: reason of the last one.
    """

    full_name: str
    state: str
    reason: str = ""
    restarts: int = 0
    last_failure: str = ""
    topics: tuple[TopicReport, ...] = ()
    timers: tuple[TimerReport, ...] = ()
    checks: tuple[CheckResult, ...] = ()
    warnings: tuple[str, ...] = ()
    traces: tuple[JointTrace, ...] = ()

    def silent_topics(self, length_s: float) -> list[TopicReport]:
        """List the topics on which nothing was published although their rate made messages due.

        Args:
            length_s: time that the node had to publish, s.
        """
        silent = [topic for topic in self.topics if topic.is_publisher and not topic.count]
        return [topic for topic in silent if topic.configured_hz * length_s >= SILENT_MESSAGES]

    @property
    def restarted(self) -> str:
        """Number and reason of restarts, such as ``restarted once: it hung``; "" if never."""
        if not self.restarts:
            return ""
        times = "once" if self.restarts == 1 else f"{self.restarts} times"
        return f"restarted {times}" + (f": {self.last_failure}" if self.last_failure else "")


class RunReport(Value):
    """A whole run.

    Attributes:
        exit_code: of the contract (0, 1, 2, 3, 4, 130).
        reason: why the run ended, one sentence.
        interrupted: whether a signal or ``joshua stop`` ended it, and it shut down cleanly.
        judged: whether a table of checks follows, which may change an exit code of 0.
        ready_s: from the start to the last ready report; None if that was not reached.
        first_message_s: from the start to the first message that a subscription received.
        stop_s: from the stop request to the last exit.
        log: path of the log file. Further results may be stored beside it; "" for none.
    """

    exit_code: int
    nodes: tuple[NodeReport, ...] = ()
    reason: str = ""
    interrupted: bool = False
    judged: bool = False
    ready_s: float | None = None
    first_message_s: float | None = None
    stop_s: float | None = None
    log: str = ""

    @property
    def headline(self) -> str:
        """The reason without those of the nodes, for a table that lists them."""
        return without_reasons(self.reason, ((node.full_name, node.reason) for node in self.nodes))


def without_reasons(text: str, reasons: Iterable[tuple[str, str]]) -> str:
    """Cut the reasons of nodes out of a sentence: "failed: /arm: no such port" ends after the name."""
    for name, reason in reasons:
        if reason:
            text = text.replace(f"{name}: {reason.rstrip('.')}", name)
    return text

"""What a run shows of itself, as plain text."""

from __future__ import annotations

import time
from collections.abc import Sequence

from joshua.plan import NodeReport, RunReport, Severity
from joshua.plan.events import LogEntry, NodeRow, Progress, RunStatus, StartTable

REPORT_HEADINGS = (
    "NODE",
    "CADENCE OF",
    "SET",
    "ACHIEVED",
    "JITTER p50",
    "p99",
    "p99.9",
    "OVERRUNS",
    "COUNT",
)

_GAP = "  "
_CONTROL = {code: f"\\x{code:02x}" for code in (*range(32), 127, *range(128, 160)) if code not in (9, 10)}


def clean(text: str) -> str:
    """Makes control characters visible, so that no node can steer the user's terminal."""
    return text.translate(_CONTROL)


def columns(rows: Sequence[Sequence[str]], *, right: frozenset[int] = frozenset()) -> list[str]:
    """Aligns cells; the columns in ``right`` at their right side."""
    widths = [max(len(row[index]) for row in rows) for index in range(len(rows[0]))]
    lines = []
    for row in rows:
        cells = [
            cell.rjust(width) if index in right else cell.ljust(width)
            for index, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append(_GAP.join(cells).rstrip())
    return lines


def start_lines(table: StartTable) -> list[str]:
    """The start-up table: node, process, backend, topics with type and rate, then warnings and notes."""
    title = [part for part in (table.source, table.mode, table.robot) if part]
    lines = [" · ".join(title), f"transport: {table.transport}", ""]
    rows = [("NODE", "PROCESS", "BACKEND", "TOPIC", "TYPE", "RATE")]
    for node in table.nodes:
        rows += _node_rows(node)
    lines += columns(rows, right=frozenset({1, 5}))
    lines.append("")
    lines += [f"warning: {node.full_name}: {text}" for node in table.nodes for text in node.warnings]
    for finding in table.findings:
        if finding.severity is not Severity.ERROR:
            place = f"{finding.position}: " if finding.position is not None else ""
            lines.append(f"{finding.severity.value}: {place}{finding.message}")
    lines += [f"note: {note}" for note in table.notes]
    count = len(table.nodes)
    who = "1 node" if count == 1 else f"all {count} nodes"
    lines.append(f"{who} ready after {table.ready_s:.2f} s; stop with Ctrl-C")
    return [clean(line) for line in lines]


def _node_rows(node: NodeRow) -> list[tuple[str, str, str, str, str, str]]:
    topics = [("out " + topic.name, topic.type_name, _hertz(topic.rate_hz)) for topic in node.publishers]
    topics += [("in  " + topic.name, topic.type_name, "") for topic in node.subscriptions]
    topics = topics or [("", "", "")]
    head = (node.full_name, str(node.process_id), node.backend)
    return [
        (*(head if index == 0 else ("", "", "")), topic, type_name, rate)
        for index, (topic, type_name, rate) in enumerate(topics)
    ]


def status_line(status: RunStatus) -> str:
    """The live status in one line: time, then each node's state or the rates of what it publishes."""
    parts = [f"{status.phase} {status.elapsed_s:.0f} s"]
    # What a node tells people comes first: it must not be cut off in a narrow terminal.
    for node in sorted(status.nodes, key=lambda node: not node.shown):
        if node.state != "ready":
            parts.append(f"{node.full_name} {node.state}")
            continue
        rates = [f"{_last_name(topic)} {rate:.1f} Hz" for topic, rate in node.published_hz.items()]
        shown = [f"[{node.shown}]"] if node.shown else []
        shown += [f"[{progress_text(item)}]" for item in node.progress]
        parts.append(" ".join([node.full_name, *shown, *rates]))
    return clean(" | ".join(parts))


def progress_text(progress: Progress) -> str:
    """How far work is, such as ``episodes 3/10, 0.5/s, 14 s left``."""
    total = "" if progress.total is None else f"/{progress.total:g}"
    unit = f" {progress.unit}" if progress.unit and progress.unit != progress.name else ""
    text = f"{progress.name} {progress.current:g}{total}{unit}"
    if progress.rate is not None:
        text += f", {progress.rate:.3g}/s"
    return text if progress.remaining_s is None else f"{text}, {progress.remaining_s:.0f} s left"


def log_line(entry: LogEntry) -> str:
    """One log entry for the terminal."""
    stamp = time.strftime("%H:%M:%S", time.localtime(entry.time_ns // 1_000_000_000))
    millis = entry.time_ns // 1_000_000 % 1000
    name = f"{entry.node}: " if entry.node else ""
    return f"{stamp}.{millis:03d} {entry.level_name:<7} {name}{clean(entry.text)}"


def report_lines(report: RunReport) -> list[str]:
    """The end of a run: cadence of every timer and publisher, what failed, and how long the stop took."""
    rows: list[tuple[str, ...]] = [REPORT_HEADINGS]
    for node in report.nodes:
        rows += _cadence_rows(node)
    lines = ["", *columns(rows, right=frozenset(range(2, 9)))] if len(rows) > 1 else []
    for node in report.nodes:
        if node.state not in ("stopped", "ready"):
            lines.append(f"{node.full_name}: {node.state}: {node.reason}")
        elif node.restarts:
            times = "once" if node.restarts == 1 else f"{node.restarts} times"
            lines.append(f"{node.full_name}: started again {times}")
        if node.state == "stopped" and node.reason:
            lines.append(f"{node.full_name}: in fault: {node.reason}")
    open_end = report.judged and not report.exit_code
    ending = f"ended: {report.reason}" if open_end else f"ended with {report.exit_code}: {report.reason}"
    if report.stop_s is not None:
        ending += f" (stopped in {report.stop_s:.2f} s)"
    return [clean(line) for line in [*lines, ending]]


def _cadence_rows(node: NodeReport) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = [
        (
            node.full_name,
            f"timer {timer.name}",
            _hertz(1.0 / timer.period_s),
            f"{timer.achieved_hz:.2f} Hz",
            *(_millis(value) for value in (timer.jitter_p50_s, timer.jitter_p99_s, timer.jitter_p999_s)),
            str(timer.overruns),
            str(timer.ticks),
        )
        for timer in node.timers
    ]
    for topic in node.topics:
        jitter = (topic.jitter_p50_s, topic.jitter_p99_s, topic.jitter_p999_s)
        known = topic.is_publisher and topic.configured_hz > 0
        rows.append(
            (
                node.full_name,
                f"{'out' if topic.is_publisher else 'in'} {topic.name}",
                _hertz(topic.configured_hz) if known else "",
                f"{topic.rate_hz:.2f} Hz",
                *(_millis(value) if known else "" for value in jitter),
                "",
                str(topic.count),
            )
        )
    return rows


def _hertz(rate_hz: float) -> str:
    return f"{rate_hz:.2f} Hz".replace(".00 Hz", " Hz") if rate_hz > 0 else "-"


def _millis(seconds: float) -> str:
    return f"{seconds * 1e3:.2f} ms"


def _last_name(topic: str) -> str:
    return topic.rpartition("/")[2]

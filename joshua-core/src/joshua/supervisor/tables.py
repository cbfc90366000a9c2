"""Terminal output of a run: tables, the status line, log lines.

Without a terminal, nothing is cut or wrapped, so a file or a program gets every column.
"""

from __future__ import annotations

import shutil
import textwrap
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TextIO

from joshua.config.diagnostics import wants_color
from joshua.plan import NodeReport, RunReport, Severity
from joshua.plan.events import LogEntry, NodeRow, NodeStatus, RunStatus, StartTable
from joshua.plan.foreign_text import printable
from joshua.plan.progress import Progress

REPORT_HEADINGS = ("NODE", "TIMER OR TOPIC", "TARGET", "ACHIEVED", "P50", "P99", "P99.9", "OVERRUNS", "COUNT")
#: An achieved rate below this share of its target is marked.
LOW = 0.9

RED, YELLOW, GREEN, DIM, BOLD = "31", "33", "32", "2", "1"
_SEVERITY = {Severity.WARNING: YELLOW, Severity.NOTE: DIM}
_STATES = {"failed": RED, "killed": RED, "fault": RED, "restarting": YELLOW, "resuming": YELLOW}

#: Topics of every node that the live status leaves out.
_HOUSEKEEPING = ("/diagnostics", "/rosout", "/parameter_events")

_GAP = "  "
NO_BREAK = "\N{NO-BREAK SPACE}"  # in a cell; printed as a space
_NARROWEST = 12  # minimum width of a shortened or wrapped column
_WRAPPED = 28  # columns are dropped before a wrapped one becomes narrower than this


@dataclass(frozen=True)
class Screen:
    """Properties of a terminal: its columns, 0 for no limit, and whether it shows colours."""

    columns: int = 0
    colour: bool = False

    @classmethod
    def of(cls, stream: TextIO) -> Screen:
        """The terminal behind a stream; no limit if there is none."""
        return cls(shutil.get_terminal_size().columns if stream.isatty() else 0, wants_color(stream))

    def paint(self, text: str, style: str) -> str:
        """A text in a style such as ``RED``."""
        text = text.replace(NO_BREAK, " ")
        return f"\x1b[{style}m{text}\x1b[0m" if self.colour and style else text

    def wrap(self, text: str, label: str = "", style: str = "", indent: int = 2) -> list[str]:
        """Wrap a sentence behind a painted label; the lines after the first are indented."""
        text, label = printable(text), printable(label)
        lines = [text]
        if self.columns:
            lines = textwrap.wrap(
                f"{label}{text}",
                self.columns,
                subsequent_indent=" " * indent,
                break_long_words=False,
                break_on_hyphens=False,
            ) or [label]
            lines[0] = lines[0][len(label) :]
        return [f"{self.paint(label, style)}{lines[0]}", *lines[1:]]


PLAIN = Screen()


class Cell(str):
    """A cell of a table with a style such as ``RED``."""

    style = ""

    @classmethod
    def of(cls, text: str, style: str) -> Cell:
        """A styled cell."""
        cell = cls(printable(text))
        cell.style = style
        return cell


def shorten(text: str, width: int) -> str:
    """Cut the middle of a text that is too wide, keeping both ends of a topic."""
    if len(text) <= width:
        return text
    head = (width - 1) // 3
    return f"{text[:head]}…{text[len(text) - (width - 1 - head) :]}"


def columns(
    rows: Sequence[Sequence[str]],
    *,
    screen: Screen = PLAIN,
    right: Iterable[int] = (),
    drop: Iterable[int] = (),
    flexible: int | None = None,
    group: int | None = None,
    header: bool = True,
) -> list[str]:
    """Align the cells of a table, and fit it into a terminal.

    Args:
        rows: cells, plain or ``Cell``; header: whether the first row names the columns.
        right: right-aligned columns.
        group: column that becomes a separate line above its rows if the table is too wide.
        drop: columns that are then dropped, the least important first.
        flexible: column that is shortened last; the last column is wrapped instead.
    """
    table = [[cell if isinstance(cell, Cell) else Cell(printable(cell)) for cell in row] for row in rows]
    widths = [max(len(cell) for cell in column) for column in zip(*table, strict=True)]
    kept = list(range(len(widths)))
    indent = ""

    def excess() -> int:
        needed = sum(widths[index] for index in kept) + len(_GAP) * (len(kept) - 1) + len(indent)
        return needed - screen.columns if screen.columns else 0

    grouped = group is not None and excess() > 0
    if group is not None and grouped:
        kept.remove(group)
        indent = _GAP
    full = widths[flexible or 0]
    if flexible is not None and flexible == kept[-1]:
        widths[flexible] = min(full, _WRAPPED)  # wrapping it is better than dropping a column
    for index in drop:
        if excess() > 0:
            kept.remove(index)
    if flexible is not None:
        widths[flexible] = full
    if flexible is not None and (over := excess()) > 0:
        widths[flexible] = max(_NARROWEST, widths[flexible] - over)
    lines: list[str] = []
    above = ""
    for number, row in enumerate(table):
        is_header = header and number == 0
        if group is not None and grouped and not is_header and row[group] != above:
            above = row[group]
            lines.append(screen.paint(above, BOLD))
        lines += _row(row, kept, widths, indent, frozenset(right), flexible, screen)
    return lines


def _row(
    row: Sequence[Cell],
    kept: Sequence[int],
    widths: Sequence[int],
    indent: str,
    right: frozenset[int],
    flexible: int | None,
    screen: Screen,
) -> list[str]:
    cells, rest, last = [], [], kept[-1]
    for index in kept:
        text: str = row[index]
        if len(text) > widths[index] and index == flexible == last:
            text, *rest = textwrap.wrap(text, widths[index], break_on_hyphens=False) or [""]
            rest = [screen.paint(line, row[index].style) for line in rest]
        text = shorten(text, widths[index])
        padded = text.rjust(widths[index]) if index in right else text.ljust(widths[index])
        cells.append(screen.paint(padded.rstrip() if index == last else padded, row[index].style))
    offset = " " * (len(indent) + sum(widths[index] + len(_GAP) for index in kept[:-1]))
    return [(indent + _GAP.join(cells)).rstrip(), *(offset + text for text in rest)]


def start_lines(table: StartTable, screen: Screen = PLAIN) -> list[str]:
    """The start-up table: node, process, backend, topics with type and rate, then warnings and notes."""
    title = [part for part in (table.source, table.mode, table.robot) if part]
    lines = [*screen.wrap(" · ".join(title)), *screen.wrap(f"transport: {table.transport}")]
    lines += [*screen.wrap(f"ROS 2 tools: {table.visible}")] * bool(table.visible)
    lines += [*screen.wrap(f"commands: {table.commands}")] * bool(table.commands)
    heading = ("NODE", "PROCESS", "BACKEND", "TOPIC", "TYPE", "RATE")
    full, short = (
        [heading, *(row for node in table.nodes for row in _node_rows(node, way))] for way in (0, 1)
    )
    layout = columns(full, right=(1, 5))
    if screen.columns and max(map(len, layout)) > screen.columns:
        layout = columns(short, screen=screen, right=(1, 5), drop=(2, 1, 4), flexible=3)
    lines += ["", *layout, ""]
    for node in table.nodes:
        for text in node.warnings:
            lines += screen.wrap(f"{node.full_name}: {text}", "warning: ", YELLOW)
    for finding in table.findings:
        if finding.severity is not Severity.ERROR:
            place = f"{finding.position}: " if finding.position is not None else ""
            label = f"{finding.severity.value}: "
            lines += screen.wrap(f"{place}{finding.message}", label, _SEVERITY[finding.severity])
    for note in table.notes:
        lines += screen.wrap(note, "note: ", DIM)
    count = len(table.nodes)
    who = "1 node" if count == 1 else f"all {count} nodes"
    return [*lines, *screen.wrap(f"{who} ready after {table.ready_s:.2f} s; stop with Ctrl-C")]


def _node_rows(node: NodeRow, short_types: int) -> list[tuple[str, ...]]:
    def type_text(name: str) -> str:
        return name.rpartition("/")[2] if short_types else name

    topics = [
        ("out " + item.name, type_text(item.type_name), _hertz(item.rate_hz)) for item in node.publishers
    ]
    topics += [("in  " + item.name, type_text(item.type_name), "") for item in node.subscriptions]
    heads = [(node.full_name, str(node.process_id), node.backend)] + [("", "", "")] * len(topics)
    return [(*head, *topic) for head, topic in zip(heads, topics or [("", "", "")], strict=False)]


def status_lines(status: RunStatus, screen: Screen = PLAIN) -> list[str]:
    """The live status: one line, or one line per node if that is too wide.

    It shows the time, then each node's state or publish rates.
    """
    head = f"{status.phase} {status.elapsed_s:.0f} s"
    # A node's own text comes first, because a narrow terminal may cut the rest.
    nodes = [node_cells(node) for node in sorted(status.nodes, key=lambda node: not node.shown)]
    width = screen.columns - 1 if screen.columns else 0
    line = " | ".join([head, *(" ".join(cells) for cells in nodes)])
    if not width or len(line) <= width:
        return [" | ".join([head, *(_fit(cells, 0, screen) for cells in nodes)])]
    return [head, *(f"  {_fit(cells, width - 2, screen)}" for cells in nodes)]


def node_cells(node: NodeStatus, *, full_topics: bool = False) -> list[Cell]:
    """A node's state in cells: its name, its text, its progress, and its publish rates."""
    texts = [node.full_name, *([f"[{node.shown}]"] if node.shown else [])]
    if node.state == "fault":
        name, *shown = map(printable, texts)
        return [Cell(name), state_cell(node), *map(Cell, shown)]
    if node.state != "ready":
        return [Cell(printable(node.full_name)), state_cell(node)]
    texts += [f"[{progress_text(item)}]" for item in node.progress]
    return [*(Cell(printable(text)) for text in texts), *_rate_cells(node, full_topics)]


def state_cell(node: NodeStatus) -> Cell:
    """A node's state."""
    return Cell.of(node.state, _STATES.get(node.state, ""))


def _rate_cells(node: NodeStatus, full_topics: bool) -> list[Cell]:
    cells = []
    for topic, rate_hz in node.published_hz.items():
        if topic in _HOUSEKEEPING:
            continue
        target_hz = node.target_hz.get(topic, 0.0)
        own = f"{node.full_name}/"  # which ROS 2 abbreviates
        whole = f"~/{topic.removeprefix(own)}" if topic.startswith(own) else topic
        name = whole if full_topics else topic.rpartition("/")[2]
        if rate_hz < LOW * target_hz:
            rate = f"{rate_hz:.1f} of {target_hz:g} Hz!".replace(" ", NO_BREAK)
            cells.append(Cell.of(f"{name} {rate}", RED))
        else:
            cells.append(Cell(printable(f"{name} {rate_hz:.1f}{NO_BREAK}Hz")))
    return cells


def _fit(cells: Sequence[Cell], width: int, screen: Screen) -> str:
    """Join cells, and cut them at a width; 0 for no limit."""
    shown, left = [], width or sum(len(cell) + 1 for cell in cells)
    for cell in cells:
        text: str = cell if len(cell) <= left else f"{cell[: max(left - 1, 0)]}…"
        shown.append(screen.paint(text, cell.style))
        left -= len(text) + 1
        if left < 2:
            break
    return " ".join(shown)


def progress_text(progress: Progress) -> str:
    """Progress of work, such as ``episodes 3/10, 0.5/s, 14 s left``."""
    total = "" if progress.total is None else f"/{progress.total:g}"
    unit = f" {progress.unit}" if progress.unit and progress.unit != progress.name else ""
    text = f"{progress.name} {progress.current:g}{total}{unit}"
    if progress.rate is not None:
        text += f", {progress.rate:.3g}/s"
    return text if progress.remaining_s is None else f"{text}, {progress.remaining_s:.0f} s left"


def log_line(entry: LogEntry, screen: Screen = PLAIN) -> str:
    """One log entry for the terminal, wrapped at its width."""
    stamp = time.strftime("%H:%M:%S", time.localtime(entry.time_ns // 1_000_000_000))
    millis = entry.time_ns // 1_000_000 % 1000
    name = f"{entry.node}: " if entry.node else ""
    text = f"{stamp}.{millis:03d} {entry.level_name:<7} {name}{entry.text}"
    return "\n".join(piece for line in text.split("\n") for piece in screen.wrap(line))


def report_lines(report: RunReport, screen: Screen = PLAIN) -> list[str]:
    """The end-of-run table: rate and jitter of every timer and publisher, then failures and the reason."""
    rows: list[tuple[str, ...]] = [REPORT_HEADINGS]
    for node in report.nodes:
        rows += _rate_rows(node)
    lines = []
    if len(rows) > 1:
        table = columns(rows, screen=screen, right=range(2, 9), group=0, drop=(8, 4), flexible=1)
        lines = ["", "jitter percentiles in ms", *table]
        if any(getattr(cell, "style", "") for row in rows for cell in row):
            lines.append(screen.paint(f"! below {LOW:.0%} of the target rate", RED))
    # A failed start ends at once, and the log line with the reason stands right above.
    said = ("stopped", "ready") if report.ready_s is not None else ("stopped", "ready", "failed")
    for node in report.nodes:
        if node.state not in said:
            lines += screen.wrap(node.reason, f"{node.full_name}: {node.state}: ", RED)
        elif node.restarts:
            lines += screen.wrap(node.restarted, f"{node.full_name}: ", YELLOW)
        if node.state == "stopped" and node.reason:
            lines += screen.wrap(node.reason, f"{node.full_name}: fault: ", RED)
    open_end = report.judged and not report.exit_code
    ending = f"ended: {report.headline}" if open_end else f"ended with {report.exit_code}: {report.headline}"
    if report.stop_s is not None:
        ending += f" (stopped in {report.stop_s:.2f} s)"
    return [*lines, *screen.wrap(ending)]


def _rate_rows(node: NodeReport) -> list[tuple[str, ...]]:
    # a rate needs at least three messages
    length_s = max((timer.ticks * timer.period_s for timer in node.timers), default=0.0)

    def achieved(rate_hz: float, target_hz: float) -> str:
        text = f"{rate_hz:.2f} Hz"
        is_low = rate_hz < LOW * target_hz and target_hz * length_s >= 3
        return Cell.of(f"{text}!", RED) if is_low else text

    rows: list[tuple[str, ...]] = []
    for timer in node.timers:
        target_hz = 1.0 / timer.period_s
        jitter = (timer.jitter_p50_s, timer.jitter_p99_s, timer.jitter_p999_s)
        name, rate = f"timer {timer.name}", achieved(timer.achieved_hz, target_hz)
        counts = (str(timer.overruns), str(timer.ticks))
        rows.append((node.full_name, name, _hertz(target_hz), rate, *map(_millis, jitter), *counts))
    for topic in node.topics:
        jitter = (topic.jitter_p50_s, topic.jitter_p99_s, topic.jitter_p999_s)
        name = f"{'out' if topic.is_publisher else 'in'} {topic.name}"
        if topic.is_publisher and topic.configured_hz > 0:
            rate = achieved(topic.rate_hz, topic.configured_hz)
            figures = (_hertz(topic.configured_hz), rate, *map(_millis, jitter))
        else:
            figures = ("", f"{topic.rate_hz:.2f} Hz", "", "", "")
        rows.append((node.full_name, name, *figures, "", str(topic.count)))
    return rows


def _hertz(rate_hz: float) -> str:
    return f"{rate_hz:.2f} Hz".replace(".00 Hz", " Hz") if rate_hz > 0 else "-"


def _millis(seconds: float) -> str:
    return f"{seconds * 1e3:.2f}"

"""The results of MODE_TEST: the pass/fail table, and files of each node's samples beside the log."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from joshua.modes.test import RAN
from joshua.plan import CheckResult, JointTrace, NodeReport, RunReport, installing
from joshua.plan.private_files import create_private, make_private
from joshua.supervisor.tables import GREEN, PLAIN, RED, YELLOW, Cell, Screen, columns

HINT = "no picture of the test, which requires the extra plots: {}"
COLUMNS = ("joint", "time_s", "goal_rad", "position_rad", "effort", "temperature_c")
BLUE, ORANGE, DARK_RED, DARK_GREEN = "#1f62be", "#e26e14", "#c4262e", "#22824c"
MOST_JOINTS = 8  # side by side


def verdict_lines(
    rows: Sequence[tuple[str, CheckResult]], report: RunReport, screen: Screen = PLAIN
) -> list[str]:
    """The table: result, node, check and measured values; then whether the test passed."""
    results = [_result(check, report) for _, check in rows]
    table = [
        (result, name, check.check, check.measured)
        for result, (name, check) in zip(results, rows, strict=True)
    ]
    lines = columns(table, screen=screen, group=1, flexible=3, header=False) if table else []
    failed = results.count(FAIL)
    if report.interrupted:
        return [*lines, screen.paint(f"test not finished: {report.reason} before its time was over", YELLOW)]
    if rows and not failed:
        return [*lines, screen.paint(f"test passed: {len(rows)} checks", GREEN)]
    problem = f"{failed} of {len(rows)} checks" if rows else "no checks"
    return [*lines, screen.paint(f"test failed: {problem}", RED)]


PASS, FAIL, UNKNOWN = Cell.of("PASS", GREEN), Cell.of("FAIL", RED), Cell.of("----", YELLOW)


def _result(check: CheckResult, report: RunReport) -> Cell:
    """The result of a check. That of a node that was stopped with the run is unknown, not failed."""
    if check.passed:
        return PASS
    stopped = report.interrupted and (check.check, check.measured) == (RAN, report.reason)
    return UNKNOWN if stopped else FAIL


def write_reports(report: RunReport) -> Iterator[str]:
    """Write the files of each node with traces. Yields a line for each. Raises OSError."""
    log = Path(report.log)
    moved = [node for node in report.nodes if report.log and node.traces]
    draw = _drawing() if moved else None
    for node in moved:
        name = node.full_name.strip("/").replace("/", "-")
        table, picture = (log.with_name(f"{log.stem}-{name}.{ending}") for ending in ("csv", "png"))
        make_private(table.parent)
        yield _written("data", table, partial(write_table, node))
        if draw is not None:
            yield _written("picture", picture, partial(draw, node))
    if moved and draw is None:
        yield HINT.format(installing.install(installing.CORE, "plots"))


def _written(what: str, path: Path, write: Callable[[Path], None]) -> str:
    try:
        create_private(path)
        write(path)
    except OSError:
        path.unlink(missing_ok=True)  # an incomplete file
        raise
    return f"{what}: {path}"


def write_table(node: NodeReport, path: Path) -> None:
    """One row for each sample of a joint. Temperatures, sampled less often, have separate rows."""
    with path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(COLUMNS)
        for trace in node.traces:
            samples = zip(trace.time_s, trace.goal_rad, trace.position_rad, trace.effort, strict=True)
            rows.writerows((trace.joint, *sample, None) for sample in samples)
            rows.writerows((trace.joint, time_s, None, None, None, at) for time_s, at in trace.temperature_c)


def _drawing() -> Callable[[NodeReport, Path], None] | None:
    """The function that draws a node, from the extra ``plots``. Its import takes a second, after the test."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        return None

    def draw(node: NodeReport, path: Path) -> None:
        traces = node.traces[:MOST_JOINTS]
        width = 12 if len(traces) == 1 else 5.5 * len(traces)
        figure = Figure(figsize=(width, 9), dpi=100, layout="constrained")
        figure.suptitle(node.full_name)
        axes = figure.subplots(4, len(traces), sharex="col", squeeze=False)
        for column, trace in zip(axes.T, traces, strict=True):
            _draw_joint(column, trace)
        figure.savefig(path)

    return draw


def _draw_joint(axes: Any, trace: JointTrace) -> None:
    time_s, position = np.array(trace.time_s), np.array(trace.position_rad)
    goal = np.array([np.nan if value is None else value for value in trace.goal_rad])
    error = np.full_like(position, np.nan)
    error[1:] = position[1:] - goal[:-1]  # a goal is compared with the state of the next cycle
    axes[0].set_title(trace.joint)
    axes[0].plot(time_s, goal, ORANGE, label="goal")
    axes[0].plot(time_s, position, BLUE, label="position")
    axes[0].legend(loc="upper right")
    axes[1].plot(time_s, error, DARK_RED)
    axes[2].plot(time_s, trace.effort, DARK_GREEN)
    if trace.temperature_c:
        axes[3].plot(*zip(*trace.temperature_c, strict=True), color=DARK_RED, marker=".")
    axes[3].set_xlabel("time, s")
    for panel, label, least in zip(
        axes, ("rad", "error, rad", "load", "temperature, °C"), (0.05, 0.02, 0.02, 4.0), strict=True
    ):
        panel.set_ylabel(label)
        panel.grid(alpha=0.3)
        low, high = panel.get_ylim()
        if high - low < least:  # keeps noise from filling the panel
            panel.set_ylim((low + high - least) / 2, (low + high + least) / 2)

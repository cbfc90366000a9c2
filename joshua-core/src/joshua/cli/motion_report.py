"""What MODE_TEST measured, as pictures beside the log: goal and position, error, load, temperature."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from joshua.devices.chart import BLUE, GREEN, ORANGE, RED, Curve, Panel, Picture, draw_panel, stack
from joshua.devices.png import encode_png
from joshua.plan import JointTrace, NodeReport, RunReport

PANEL_HEIGHT = 230
WIDE, NARROW = 1200, 560  # of one joint alone, and of several side by side
MOST_JOINTS = 8  # side by side


def draw_report(report: RunReport) -> Iterator[Path]:
    """Draws one picture for each node that has traces; yields the files. Raises OSError."""
    log = Path(report.log)
    for node in report.nodes:
        if not (report.log and node.traces):
            continue
        name = node.full_name.strip("/").replace("/", "-")
        path = log.with_name(f"{log.stem}-{name}.png")
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            path.write_bytes(encode_png(draw_node(node)))
        except OSError:
            path.unlink(missing_ok=True)  # half a picture
            raise
        yield path


def draw_node(node: NodeReport) -> Picture:
    """One column of panels for each joint."""
    width = WIDE if len(node.traces) == 1 else NARROW
    prefix = f"{node.full_name} " if len(node.traces) == 1 else ""
    columns = [_column(trace, f"{prefix}{trace.joint}, rad", width) for trace in node.traces[:MOST_JOINTS]]
    return stack(list(zip(*columns, strict=True)))


def _column(trace: JointTrace, title: str, width: int) -> list[Picture]:
    time_s = np.array(trace.time_s)
    goal = np.array([np.nan if value is None else value for value in trace.goal_rad])
    position = np.array(trace.position_rad)
    error = np.full_like(position, np.nan)
    error[1:] = position[1:] - goal[:-1]  # a goal is compared with the state of the next cycle
    x_range = (0.0, float(max(time_s[-1], 1e-3)))
    panels = [
        Panel(
            title,
            (Curve("goal", time_s, goal, ORANGE), Curve("position", time_s, position, BLUE)),
            0.05,
        ),
        Panel("error, rad", (Curve("position - goal", time_s, error, RED),), 0.02),
        Panel("load", (Curve("effort", time_s, np.array(trace.effort), GREEN),), 0.02),
    ]
    heat = np.array(trace.temperature_c).reshape(-1, 2)
    panels.append(Panel("temperature, °C", (Curve("", heat[:, 0], heat[:, 1], RED),), 4.0, "time, s"))
    return [
        draw_panel(Panel(p.title, p.curves, p.least_span, p.x_label, x_range), width, PANEL_HEIGHT)
        for p in panels
    ]

"""Picture of a finished training: its metrics over its steps, as an SVG made without a library."""

from __future__ import annotations

import json
import math
from html import escape
from pathlib import Path
from typing import Any

from joshua_training.run_folder import RunFolder

PICTURE = "curves.svg"

_WIDTH, _HEIGHT = 640, 220
_LEFT, _RIGHT, _TOP, _BOTTOM = 76, 24, 34, 40
_COLOURS = ("#1f77b4", "#e07b00", "#2a9d4f", "#b03a8c", "#7a5195", "#8c6d31")

#: Groups of metrics, named before the slash, that do not describe learning.
_LEFT_OUT = ("rate",)


def draw(folder: RunFolder) -> Path | None:
    """Draw ``metrics.jsonl`` into ``curves.svg``, one plot for each group; None without any metrics.

    Raises:
        OSError: it cannot be written.
    """
    groups = _groups(folder.path / "metrics.jsonl")
    if not groups:
        return None
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {_HEIGHT * len(groups)}" '
        'font-family="sans-serif" font-size="13">',
        f"<title>Metrics of {escape(folder.path.name)} over the steps of the training</title>",
        f'<rect width="{_WIDTH}" height="{_HEIGHT * len(groups)}" fill="#ffffff"/>',
    ]
    for index, (name, curves) in enumerate(groups.items()):
        parts += [f'<g transform="translate(0 {index * _HEIGHT})">', *_plot(name, curves), "</g>"]
    path = folder.path / PICTURE
    path.write_text("\n".join([*parts, "</svg>", ""]), encoding="utf-8")
    return path


def _groups(path: Path) -> dict[str, dict[str, list[tuple[float, float]]]]:
    """Return points (steps, value) by group and name."""
    found: dict[str, dict[str, list[tuple[float, float]]]] = {}
    lines = path.read_text(encoding="utf-8").splitlines() if path.is_file() else []
    for line in lines:
        try:
            row: dict[str, Any] = json.loads(line)
            steps = float(row["steps"])
        except (ValueError, KeyError, TypeError):
            continue
        for key, value in row.items():
            group, slash, name = key.partition("/")
            if slash and group not in _LEFT_OUT and isinstance(value, (int, float)) and math.isfinite(value):
                found.setdefault(group, {}).setdefault(name, []).append((steps, float(value)))
    return found


def _plot(name: str, curves: dict[str, list[tuple[float, float]]]) -> list[str]:
    values = [value for points in curves.values() for _, value in points]
    low, high = min(values), max(values)
    # values that span powers of ten get a logarithmic scale
    is_log = low > 0 and high / low > 50
    scale = math.log10 if is_log else float
    bottom, top = scale(low), scale(high)
    span = top - bottom or abs(top) or 1.0
    most = max(step for points in curves.values() for step, _ in points) or 1.0
    wide, tall = _WIDTH - _LEFT - _RIGHT, _HEIGHT - _TOP - _BOTTOM

    def place(steps: float, value: float) -> tuple[float, float]:
        return _LEFT + wide * steps / most, _TOP + tall * (1 - (scale(value) - bottom) / span)

    parts = [f'<text x="{_LEFT}" y="20" font-weight="bold">{escape(name)}</text>']
    for part in (0.0, 0.5, 1.0):
        shown = bottom + part * (top - bottom)
        y = _TOP + tall * (1 - part)
        label = f"{10**shown if is_log else shown:.3g}"
        parts.append(f'<path d="M{_LEFT} {y:.1f}H{_LEFT + wide}" stroke="#dddddd"/>')
        parts.append(f'<text x="{_LEFT - 8}" y="{y + 4:.1f}" text-anchor="end">{label}</text>')
        x = _LEFT + wide * part
        parts.append(f'<text x="{x:.0f}" y="{_HEIGHT - 18}" text-anchor="middle">{most * part:,.0f}</text>')
    right = _WIDTH - _RIGHT
    for index, (key, points) in enumerate(curves.items()):
        colour = _COLOURS[index % len(_COLOURS)]
        places = " ".join("{:.1f},{:.1f}".format(*place(*point)) for point in points)
        if len(points) == 1:
            x, y = place(*points[0])
            parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="{colour}"/>')
        parts.append(f'<polyline points="{places}" fill="none" stroke="{colour}" stroke-width="2"/>')
        parts.append(f'<text x="{right}" y="20" fill="{colour}" text-anchor="end">{escape(key)}</text>')
        right -= 8 * len(key) + 14
    return parts

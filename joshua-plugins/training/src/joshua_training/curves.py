"""Picture of a finished training: its metrics over its steps, as an SVG made without a library."""

from __future__ import annotations

import math
from html import escape
from pathlib import Path
from typing import Any

from joshua.tools import parse_json

from joshua_training.run_folder import RunFolder

PICTURE = "curves.svg"

_WIDTH, _HEIGHT = 640, 220
_LEFT, _RIGHT, _TOP, _BOTTOM = 76, 24, 34, 40
_COLOURS = ("#1f77b4", "#e07b00", "#2a9d4f", "#b03a8c", "#7a5195", "#8c6d31", "#1aa6b7", "#555555")

#: Height of a line of the legend, and widths of a letter of it and of a plot's bold name, at most.
_LINE, _LETTER, _BOLD = 18, 8, 9

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
    plots, height = list[str](), 0
    for name, curves in groups.items():
        legend = _legend(name, list(curves))
        plots += [f'<g transform="translate(0 {height})">', *_plot(name, curves, legend), "</g>"]
        height += _HEIGHT + _LINE * legend[-1][0]
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {height}" '
        'font-family="sans-serif" font-size="13">',
        f"<title>Metrics of {escape(folder.path.name)} over the steps of the training</title>",
        f'<rect width="{_WIDTH}" height="{height}" fill="#ffffff"/>',
        *plots,
    ]
    path = folder.path / PICTURE
    path.write_text("\n".join([*parts, "</svg>", ""]), encoding="utf-8")
    return path


def _groups(path: Path) -> dict[str, dict[str, list[tuple[float, float]]]]:
    """Return points (steps, value) by group and name."""
    found: dict[str, dict[str, list[tuple[float, float]]]] = {}
    lines = path.read_text(encoding="utf-8").splitlines() if path.is_file() else []
    for line in lines:
        try:
            row: dict[str, Any] = parse_json(line)
            steps = float(row["steps"])
        except (ValueError, KeyError, TypeError):
            continue
        for key, value in row.items():
            group, slash, name = key.partition("/")
            if slash and group not in _LEFT_OUT and isinstance(value, (int, float)) and math.isfinite(value):
                found.setdefault(group, {}).setdefault(name, []).append((steps, float(value)))
    return found


def _legend(name: str, keys: list[str]) -> list[tuple[int, int]]:
    """Return the line and the right end of each entry; what does not fit beside the name goes below."""
    line, right, left = 0, _WIDTH - _RIGHT, _LEFT + _BOLD * len(name) + 14
    places = []
    for key in keys:
        if right - _LETTER * len(key) < left and right < _WIDTH - _RIGHT:
            line, right, left = line + 1, _WIDTH - _RIGHT, _LEFT
        places.append((line, right))
        right -= _LETTER * len(key) + 14
    return places


def _plot(
    name: str, curves: dict[str, list[tuple[float, float]]], legend: list[tuple[int, int]]
) -> list[str]:
    values = [value for points in curves.values() for _, value in points]
    low, high = min(values), max(values)
    # values that span powers of ten get a logarithmic scale
    is_log = low > 0 and high / low > 50
    scale = math.log10 if is_log else float
    bottom, top = scale(low), scale(high)
    span = top - bottom or abs(top) or 1.0
    most = max(step for points in curves.values() for step, _ in points) or 1.0
    wide, tall = _WIDTH - _LEFT - _RIGHT, _HEIGHT - _TOP - _BOTTOM
    top_y = _TOP + _LINE * legend[-1][0]

    def place(steps: float, value: float) -> tuple[float, float]:
        return _LEFT + wide * steps / most, top_y + tall * (1 - (scale(value) - bottom) / span)

    parts = [f'<text x="{_LEFT}" y="20" font-weight="bold">{escape(name)}</text>']
    for part in (0.0, 0.5, 1.0):
        shown = bottom + part * (top - bottom)
        y = top_y + tall * (1 - part)
        label = f"{10**shown if is_log else shown:.3g}"
        parts.append(f'<path d="M{_LEFT} {y:.1f}H{_LEFT + wide}" stroke="#dddddd"/>')
        parts.append(f'<text x="{_LEFT - 8}" y="{y + 4:.1f}" text-anchor="end">{label}</text>')
        x = _LEFT + wide * part
        anchor = "end" if part == 1.0 else "middle"  # large numbers would leave the picture
        labelled = f'x="{x:.0f}" y="{top_y + tall + _BOTTOM - 18}" text-anchor="{anchor}"'
        parts.append(f"<text {labelled}>{most * part:,.0f}</text>")
    for index, ((key, points), (line, right)) in enumerate(zip(curves.items(), legend, strict=True)):
        colour = _COLOURS[index % len(_COLOURS)]
        places = " ".join("{:.1f},{:.1f}".format(*place(*point)) for point in points)
        if len(points) == 1:
            x, y = place(*points[0])
            parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="{colour}"/>')
        parts.append(f'<polyline points="{places}" fill="none" stroke="{colour}" stroke-width="2"/>')
        legend_at = f'x="{right}" y="{20 + _LINE * line}" text-anchor="end"'
        parts.append(f'<text {legend_at} fill="{colour}">{escape(key)}</text>')
    return parts

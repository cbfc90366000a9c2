"""How well an arm followed a replay: a table, and a picture of goal and position of each joint."""

from __future__ import annotations

import html
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

#: Size of a joint's panel in the picture, and the most points of one line.
WIDTH, HEIGHT, MOST_POINTS = 760, 130, 800

GOAL, POSITION, GREY = "#1f62be", "#e26e14", "#7a8491"


class Tracking:
    """Goals and measured positions of one arm in one episode.

    Args:
        names: of the joints.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self.names = tuple(names)
        self._time_s: list[float] = []
        self._goals: list[npt.NDArray[np.float64]] = []
        self._positions: list[npt.NDArray[np.float64]] = []

    def add(self, time_s: float, goal_rad: Any, position_rad: Any) -> None:
        """Note a goal and the newest position, in the order of the joints."""
        self._time_s.append(time_s)
        self._goals.append(goal_rad)
        self._positions.append(position_rad)

    def __len__(self) -> int:
        return len(self._time_s)

    def table(self) -> Iterator[str]:
        """Yield a line for each joint: its error in radians as mean, 95th percentile and largest."""
        for name, (mean, p95, largest) in zip(self.names, self._figures(), strict=True):
            yield f"{name:<20} {mean:.3f}  {p95:.3f}  {largest:.3f}"

    def svg(self, title: str) -> str:
        """Draw the picture: goals in blue, positions in orange."""
        step = max(1, len(self) // MOST_POINTS)
        time_s = np.array(self._time_s[::step])
        goals, positions = np.stack(self._goals[::step]), np.stack(self._positions[::step])
        figures = self._figures()
        panels = [
            _panel(name, time_s, goals[:, i], positions[:, i], figures[i], 40 + i * HEIGHT)
            for i, name in enumerate(self.names)
        ]
        height = 40 + HEIGHT * len(self.names) + 24
        end = f'text-anchor="end" fill="{GREY}">{time_s[-1]:.1f} s</text>'
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" width="{WIDTH}" '
            f'height="{height}" font-family="sans-serif" font-size="12">'
            f'<rect width="100%" height="100%" fill="#ffffff"/>'
            f'<text x="12" y="22" font-size="15">{html.escape(title)}</text>'
            f'<text x="{WIDTH - 12}" y="22" text-anchor="end"><tspan fill="{GOAL}">goal</tspan>  '
            f'<tspan fill="{POSITION}">position</tspan>  <tspan fill="{GREY}">rad</tspan></text>'
            f'{"".join(panels)}<text x="12" y="{height - 8}" fill="{GREY}">0 s</text>'
            f'<text x="{WIDTH - 12}" y="{height - 8}" {end}</svg>\n'
        )

    def _figures(self) -> list[tuple[float, float, float]]:
        errors = np.abs(np.stack(self._goals) - np.stack(self._positions))
        return [(float(e.mean()), float(np.quantile(e, 0.95)), float(e.max())) for e in errors.T]


def _panel(
    name: str,
    time_s: npt.NDArray[np.float64],
    goal: npt.NDArray[np.float64],
    position: npt.NDArray[np.float64],
    figures: tuple[float, float, float],
    top: int,
) -> str:
    low, high = float(min(goal.min(), position.min())), float(max(goal.max(), position.max()))
    span = max(high - low, 0.02)
    inner = HEIGHT - 34

    def line(values: npt.NDArray[np.float64], colour: str) -> str:
        x = 12 + (WIDTH - 24) * (time_s - time_s[0]) / max(time_s[-1] - time_s[0], 1e-9)
        y = top + 24 + inner * (1 - (values - low) / span)
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
        return f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.4"/>'

    mean, p95, largest = figures
    return (
        f'<rect x="12" y="{top + 20}" width="{WIDTH - 24}" height="{inner + 8}" fill="#f5f7fa"/>'
        f'<text x="12" y="{top + 14}">{html.escape(name)}</text>'
        f'<text x="{WIDTH - 12}" y="{top + 14}" text-anchor="end" fill="{GREY}">{low:.2f} to {high:.2f}, '
        f"error: mean {mean:.3f}, p95 {p95:.3f}, largest {largest:.3f}</text>"
        f"{line(goal, GOAL)}{line(position, POSITION)}"
    )

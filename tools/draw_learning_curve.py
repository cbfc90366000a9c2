"""Draws how often a policy succeeds while it learns, from what ``bench_ppo.py --curves FILE`` wrote."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

PICTURE = Path(__file__).resolve().parent.parent / "docs" / "images" / "learning-reach.svg"
WIDTH, HEIGHT = 640, 320
LEFT, RIGHT, TOP, BOTTOM = 64, 24, 24, 56
COLOURS = ("#1f77b4", "#e07b00", "#2a9d4f", "#b03a8c")


def drawn(curves: list[dict[str, Any]]) -> str:
    """Returns the picture: one line for each seed."""
    most = max(row[0] for item in curves for row in item["curve"])
    wide, high = WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM

    def place(steps: float, success: float) -> tuple[float, float]:
        return LEFT + wide * steps / most, TOP + high * (1 - success)

    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" '
        'font-size="13">',
        "<title>Share of episodes in which the arm reaches its goal, over the environment steps of PPO, "
        f"for {len(curves)} seeds</title>",
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#ffffff"/>',
    ]
    for success in (0.0, 0.25, 0.5, 0.75, 1.0):
        x, y = place(0, success)
        parts.append(f'<path d="M{x:.0f} {y:.1f}H{LEFT + wide}" stroke="#dddddd"/>')
        parts.append(f'<text x="{x - 8:.0f}" y="{y + 4:.1f}" text-anchor="end">{success:g}</text>')
    for tick in range(0, int(most) + 1, 20_000):
        x, y = place(tick, 0.0)
        shown = f"{tick // 1000}k" if tick else "0"
        parts.append(f'<text x="{x:.1f}" y="{y + 20:.1f}" text-anchor="middle">{shown}</text>')
    x, y = place(most, 0.95)
    parts.append(f'<path d="M{LEFT} {y:.1f}H{x:.0f}" stroke="#888888" stroke-dasharray="4 4"/>')
    parts.append(f'<text x="{LEFT + 4}" y="{y - 5:.1f}" fill="#555555">0.95</text>')
    for index, item in enumerate(curves):
        colour = COLOURS[index % len(COLOURS)]
        points = " ".join("{:.1f},{:.1f}".format(*place(row[0], row[1])) for row in item["curve"])
        parts.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="2"/>')
        y = TOP + high - 18 * (len(curves) - index)
        parts.append(
            f'<text x="{WIDTH - RIGHT}" y="{y}" fill="{colour}" text-anchor="end">seed {item["seed"]}</text>'
        )
    middle = LEFT + wide / 2
    parts.append(f'<text x="{middle:.0f}" y="{HEIGHT - 12}" text-anchor="middle">environment steps</text>')
    across = f"rotate(-90 18 {TOP + high / 2:.0f})"
    parts.append(
        f'<text x="18" y="{TOP + high / 2:.0f}" text-anchor="middle" transform="{across}">success</text>'
    )
    return "\n".join([*parts, "</svg>", ""])


def main(names: list[str]) -> int:
    """Draw the picture from the file of curves and return the exit code."""
    if len(names) != 1:
        sys.stderr.write("usage: draw_learning_curve.py CURVES.json (see tests/learn/bench_ppo.py)\n")
        return 2
    PICTURE.write_text(drawn(json.loads(Path(names[0]).read_text(encoding="utf-8"))), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

"""Draws what two strategies do with the same flow policy 0.3 s late, for the guide to policies.

The policy was trained here (tests/support/reach_flow.py) and drives the simulated arm past a bar; time is
stepped, so that the picture is the same each time.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parent.parent / "tests" / "support"))

from reach_flow import RATE_HZ, Run, Scene, drive

ROOT = Path(__file__).resolve().parent.parent
PICTURE = ROOT / "docs" / "images" / "chunks.svg"
WIDTH, PANEL, GAP, LEFT, TOP = 560, 170, 66, 78, 40
PATH, BORDER, TEXT, SOFT = "#5c6bc0", "#ffb300", "#455a64", "#b0bec5"
SEED, SHOWN_S, JOINT = 5, 3.2, 1  # the shoulder's lift
MIDDLE_RAD, LARGEST_RAD, LINE_RAD = -1.75, 0.25, 0.15
PANELS = (
    ("REPLACE_ON_ARRIVAL", "REPLACE_ON_ARRIVAL: each chunk begins anew"),
    ("REAL_TIME_CHUNKING", "REAL_TIME_CHUNKING: each continues the last"),
)


def draw() -> str:
    """The picture as SVG: the commands of one joint over time, a panel for each strategy."""
    height = TOP + len(PANELS) * (PANEL + GAP) + 10
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" '
        'font-family="system-ui, sans-serif" font-size="14" role="img">',
        "<title>Commands of one joint under two strategies, chunks 0.3 s late</title>",
        f'<rect width="{WIDTH}" height="{height}" rx="10" fill="#fafafa"/>',
    ]
    scene = Scene()
    for number, (strategy, title) in enumerate(PANELS):
        lines += panel(drive(strategy, seed=SEED, scene=scene), title, TOP + number * (PANEL + GAP))
    return "\n".join([*lines, "</svg>", ""])


def panel(run: Run, title: str, top: float) -> list[str]:
    """The commands of one run, its borders marked."""
    count = round(SHOWN_S * RATE_HZ)
    across = (WIDTH - LEFT - 30) / count
    middle = top + PANEL / 2

    def place(step: int) -> str:
        share = (run.commands[step, JOINT] - MIDDLE_RAD) / LARGEST_RAD
        return f"{LEFT + step * across:.1f} {middle - share * PANEL / 2:.1f}"

    worst = f"largest jump {run.figures.border_rad:.2f} rad, {run.figures.border_rad_s:.1f} rad/s"
    right, low = LEFT + count * across, top + PANEL
    lines = [
        _text(LEFT, top - 12, title, weight=600),
        _text(LEFT, low + 20, f"{SHOWN_S:g} s"),
        _text(right, low + 20, worst, anchor="end"),
        f'<path d="M{LEFT} {top} H{right:.1f} V{low} H{LEFT} Z" fill="#fff" stroke="{SOFT}"/>',
    ]
    for value in (MIDDLE_RAD - LINE_RAD, MIDDLE_RAD, MIDDLE_RAD + LINE_RAD):
        y = middle - (value - MIDDLE_RAD) / LARGEST_RAD * PANEL / 2
        lines.append(f'<path d="M{LEFT} {y:.1f} H{right:.1f}" stroke="#eceff1"/>')
        lines.append(_text(LEFT - 8, y + 5, f"{value:g} rad", anchor="end"))
    lines += [
        f'<line x1="{LEFT + step * across:.1f}" x2="{LEFT + step * across:.1f}" y1="{top}" '
        f'y2="{top + PANEL}" stroke="{BORDER}" stroke-dasharray="4 4"/>'
        for step in run.borders
        if step < count
    ]
    path = " L".join(place(step) for step in range(min(count, len(run.commands))))
    return [*lines, f'<path d="M{path}" fill="none" stroke="{PATH}" stroke-width="2.5"/>']


def _text(x: float, y: float, text: str, *, weight: int = 400, anchor: str = "start") -> str:
    return (
        f'<text x="{x:g}" y="{y:g}" fill="{TEXT}" font-weight="{weight}" text-anchor="{anchor}">{text}</text>'
    )


if __name__ == "__main__":
    PICTURE.write_text(draw(), encoding="utf-8")
    sys.stdout.write(f"{PICTURE.relative_to(ROOT)}\n")

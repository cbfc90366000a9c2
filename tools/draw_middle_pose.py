"""Draws the middle pose of an SO-100 or SO-101 arm, for the guide and the page of the calibration.

Lengths are those of the public model of the SO-ARM100, in millimetres; the pose is the middle of each range.
"""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PICTURES = (
    ROOT / "docs" / "images" / "middle-pose.svg",
    ROOT / "joshua-plugins" / "calibration" / "src" / "joshua_calibration" / "page" / "middle-pose.svg",
)
UPPER_ARM, FOREARM, WRIST, JAW = 116, 135, 60, 100
SHOULDER = (150, 236)  # of the side view, in its pixels
SCALE = 1.25
WIDTH, HEIGHT, GROUND = 760, 350, 318
LINK, JOINT, TEXT, SOFT = "#5c6bc0", "#ffb300", "#455a64", "#90a4ae"


def draw() -> str:
    """The picture as SVG: the arm from the side and from above."""
    x, y = SHOULDER
    elbow = (x, y - UPPER_ARM * SCALE)
    wrist = (x + FOREARM * SCALE, elbow[1])
    roll = (wrist[0] + WRIST * SCALE * 0.6, wrist[1])
    jaw = (wrist[0] + WRIST * SCALE, wrist[1])
    tip = jaw[0] + JAW * SCALE * 0.7
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" '
        'font-family="system-ui, sans-serif" font-size="14" role="img">',
        "<title>Middle pose: upper arm upright, forearm and gripper level, jaw half open</title>",
        f'<rect width="{WIDTH}" height="{HEIGHT}" rx="10" fill="#fafafa"/>',
        _text(24, 30, "From the side", weight=600),
        f'<line x1="24" y1="{GROUND}" x2="520" y2="{GROUND}" stroke="{SOFT}" stroke-width="2"/>',
        f'<path d="M{x - 52} {GROUND} V{GROUND - 34} H{x - 30} L{x - 18} {y} H{x + 18} '
        f'L{x + 26} {GROUND - 34} H{x + 40} V{GROUND} Z" fill="#cfd8dc"/>',
        _link(SHOULDER, elbow),
        _link(elbow, wrist),
        _link(wrist, jaw, width=18),
        f'<path d="M{jaw[0]} {jaw[1] + 4} H{tip} v10 H{jaw[0]} Z" fill="{LINK}"/>',
        f'<path d="M{jaw[0]} {jaw[1] - 4} L{tip - 14} {jaw[1] - 52} l6 8 L{jaw[0] + 8} {jaw[1] + 6} Z" '
        'fill="#9fa8da"/>',
        *(_joint(*place) for place in (SHOULDER, elbow, wrist, roll, jaw)),
        _text(x - 40, GROUND - 12, "1 shoulder_pan"),
        _text(x + 26, y + 6, "2 shoulder_lift: upright"),
        _text(x - 18, elbow[1] - 18, "3 elbow_flex: right angle"),
        _text(wrist[0] - 70, wrist[1] + 36, "4 wrist_flex: straight"),
        _text(roll[0] - 34, roll[1] + 60, "5 wrist_roll: jaw on top"),
        _text(jaw[0] + 6, jaw[1] - 66, "6 gripper: half open"),
        _text(570, 30, "From above", weight=600),
        '<rect x="596" y="236" width="88" height="70" rx="8" fill="#cfd8dc"/>',
        _link((640, 262), (640, 90)),
        f'<line x1="640" y1="236" x2="640" y2="60" stroke="{SOFT}" stroke-dasharray="5 5"/>',
        _joint(640, 262),
        _text(640, 330, "straight ahead", anchor="middle"),
    ]
    return "\n".join([*lines, "</svg>", ""])


def _link(start: tuple[float, float], end: tuple[float, float], width: int = 24) -> str:
    return (
        f'<line x1="{start[0]:g}" y1="{start[1]:g}" x2="{end[0]:g}" y2="{end[1]:g}" stroke="{LINK}" '
        f'stroke-width="{width}" stroke-linecap="round"/>'
    )


def _joint(x: float, y: float) -> str:
    return f'<circle cx="{x:g}" cy="{y:g}" r="8" fill="{JOINT}" stroke="#fff" stroke-width="2"/>'


def _text(x: float, y: float, text: str, *, weight: int = 400, anchor: str = "start") -> str:
    return (
        f'<text x="{x:g}" y="{y:g}" fill="{TEXT}" font-weight="{weight}" text-anchor="{anchor}">{text}</text>'
    )


if __name__ == "__main__":
    for picture in PICTURES:
        picture.write_text(draw(), encoding="utf-8")
        sys.stdout.write(f"{picture.relative_to(ROOT)}\n")

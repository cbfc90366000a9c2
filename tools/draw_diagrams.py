"""Draws the diagrams of the documentation: boxes, arrows and time lines, wide enough for a phone."""

from __future__ import annotations

import sys
from html import escape
from pathlib import Path

IMAGES = Path(__file__).resolve().parent.parent / "docs" / "images"
WIDTH, FONT = 560, 'font-family="system-ui, sans-serif"'
INK, SOFT, LINE = "#263238", "#455a64", "#546e7a"
GREY, BLUE, GREEN, AMBER = "#eceff1", "#e3f2fd", "#e8f5e9", "#fff8e1"
Box = tuple[float, float, float, float]  # left, top, width, height


def road() -> str:
    """Return the road from a file to the topics of a robot."""
    width, height, left, right, top, low = 132, 64, 14, 414, 20, 158
    middle = (left + right) / 2
    boxes = {
        "robot.pbtxt": ((left, top, width, height), "the text", GREY),
        "Config": ((middle, top, width, height), "with positions", BLUE),
        "Diagnostics": ((right, top, width, height), "every problem", BLUE),
        "Plan": ((right, low, width, height), "what will run", BLUE),
        "Processes": ((middle, low, width, height), "one per node", GREEN),
        "Topics": ((left, low, width, height), "ROS 2", GREEN),
    }
    steps = ("load", "check", "plan", "supervise", "publish")
    places = [place for place, _, _ in boxes.values()]
    body = [_box(place, name, below, fill) for name, (place, below, fill) in boxes.items()]
    body += [_arrow(a, b, step) for a, b, step in zip(places, places[1:], steps, strict=False)]
    body.append(_text(left, 116, "blue: pure; opens no device, imports no driver", anchor="start"))
    body.append(_text(left, 138, "green: child processes, under supervision", anchor="start"))
    return _svg(240, "The road: a file is loaded, checked, planned and supervised", body)


def commands() -> str:
    """Return how commands from outside reach a follower."""
    top, low, reader = (14.0, 20.0, 132.0, 64.0), (14.0, 116.0, 132.0, 64.0), (14.0, 212.0, 132.0, 64.0)
    arm = (386.0, 20.0, 160.0, 160.0)
    body = [
        _box(top, "MoveIt", "JointTrajectory", GREY),
        _box(low, "your node", "JointState", GREY),
        _box(reader, "RViz, rosbag2", "any ROS 2 tool", GREY),
        _box(arm, "follower_arm", "one commander,", GREEN),
        _text(466, 138, "limits, ramp, watchdog", size=13),
        _path("M146 52 H382"),
        _text(264, 42, "/follower/joint_trajectory"),
        _path("M146 148 H382"),
        _text(264, 138, "/follower/joint_commands"),
        _path("M466 180 V244 H150"),
        _text(300, 234, "/follower/joint_states"),
        _text(300, 266, "/follower_arm/applied_command"),
    ]
    return _svg(296, "Nodes outside the file command a follower over two external topics", body)


def cluster() -> str:
    """Return how a command spreads episodes over the nodes of a Ray cluster."""
    command, head = (14.0, 86.0, 132.0, 64.0), (214.0, 86.0, 132.0, 64.0)
    nodes = [(414.0, 14.0 + 72.0 * number, 132.0, 60.0) for number in range(3)]
    body = [
        _box(command, "your command", "--ray ADDRESS", BLUE),
        _box(head, "Ray's head", "schedules", GREY),
        *(_box(place, f"node {number}", "a worker a core", GREEN) for number, place in enumerate(nodes, 1)),
        _arrow(command, head, "episodes"),
        *(_path(f"M346 118 L410 {int(top + 30)}") for _, top, _, _ in nodes),
        _path("M480 218 V256 H80 V154"),
        _text(280, 246, "results, in order"),
        _text(
            14, 290, "Keep robots out of the cluster: Ray's messages can run code.", anchor="start", size=13
        ),
    ]
    return _svg(304, "A command spreads the episodes of a data set over a Ray cluster", body)


def frames() -> str:
    """Return how samples of streams become frames at a fixed rate."""
    left, right, step = 184, 530, 69
    streams = (
        ("observation.state", 54, [left + 19 * n - 6 for n in range(20)], BLUE),
        ("observation.images.top", 104, [left + 8 + 64 * n for n in range(3)] + [456, 522], GREEN),
        ("action", 154, [left + 35 * n - 15 for n in range(11)], AMBER),
    )
    body = [_text(left + step * n, 24, f"frame {n}", size=13) for n in range(6)]
    body += [
        f'<line x1="{left + step * n}" y1="32" x2="{left + step * n}" y2="176" stroke="{LINE}" '
        'stroke-dasharray="4 4"/>'
        for n in range(6)
    ]
    for name, y, times, fill in streams:
        body.append(f'<line x1="{left - 24}" y1="{y}" x2="{right + 10}" y2="{y}" stroke="#b0bec5"/>')
        body.append(_text(10, y - 12, name, anchor="start", size=13))
        body += [
            f'<circle cx="{x}" cy="{y}" r="6" fill="{fill}" stroke="{LINE}" stroke-width="1.4"/>'
            for x in times
            if left - 24 <= x <= right + 10
        ]
    missing = left + 3 * step
    body.append(f'<circle cx="{missing}" cy="104" r="10" fill="none" stroke="#c62828" stroke-width="2.5"/>')
    body.append(_text(280, 206, "circles: samples, at the time of their acquisition"))
    body.append(_text(280, 228, "red: no sample within the tolerance, named in frame.missing"))
    return _svg(246, "Samples of three streams become frames at a fixed rate; one value is missing", body)


def _box(place: Box, title: str, below: str, fill: str) -> str:
    x, y, width, height = place
    return (
        f'<rect x="{x:g}" y="{y:g}" width="{width:g}" height="{height:g}" rx="8" fill="{fill}" '
        f'stroke="#b0bec5"/>'
        + _text(x + width / 2, y + height / 2 - 4, title, size=16, weight=600, colour=INK)
        + _text(x + width / 2, y + height / 2 + 17, below, size=13.5)
    )


def _arrow(a: Box, b: Box, label: str) -> str:
    """Return an arrow between two boxes beside or above each other."""
    if a[0] == b[0]:
        x = a[0] + a[2] / 2
        return _path(f"M{x:g} {a[1] + a[3]:g} V{b[1] - 4:g}") + _text(
            x + 24, (a[1] + a[3] + b[1]) / 2 + 4, label, size=13
        )
    y = a[1] + a[3] / 2
    start, end = (a[0] + a[2], b[0] - 4) if a[0] < b[0] else (a[0], b[0] + b[2] + 4)
    return _path(f"M{start:g} {y:g} H{end:g}") + _text((start + end) / 2, y - 9, label, size=13)


def _path(points: str) -> str:
    return f'<path d="{points}" fill="none" stroke="{LINE}" stroke-width="1.8" marker-end="url(#tip)"/>'


def _text(
    x: float,
    y: float,
    text: str,
    *,
    size: float = 14,
    weight: int = 400,
    anchor: str = "middle",
    colour: str = SOFT,
) -> str:
    return (
        f'<text x="{x:g}" y="{y:g}" font-size="{size:g}" font-weight="{weight}" text-anchor="{anchor}" '
        f'fill="{colour}">{escape(text)}</text>'
    )


def _svg(height: int, title: str, body: list[str]) -> str:
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" role="img" {FONT}>',
            f"<title>{escape(title)}</title>",
            '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" '
            f'orient="auto"><path d="M0 0L8 4L0 8z" fill="{LINE}"/></marker></defs>',
            f'<rect width="{WIDTH}" height="{height}" rx="12" fill="#fafafa"/>',
            *body,
            "</svg>",
            "",
        ]
    )


DIAGRAMS = {"road.svg": road, "ros-commands.svg": commands, "frames.svg": frames, "cluster.svg": cluster}


def main() -> int:
    """Write the diagrams and return the exit code."""
    for name, draw in DIAGRAMS.items():
        (IMAGES / name).write_text(draw(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())

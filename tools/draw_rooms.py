"""Draws docs/images/rooms.svg: the rooms of joshua-core and the arrows that test_rooms.py holds."""

from __future__ import annotations

import ast
import re
import sys
from html import escape
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PICTURE = ROOT / "docs" / "images" / "rooms.svg"
WIDTH, BOX, GAP_X, ROW, TOP = 1040, (124, 46), 16, 84, 24
_LEFT_OUT = ("builtin_plugin", "__main__")  # an entry point each, no room
_FONT = 'font-family="system-ui, sans-serif"'


def stands_on() -> dict[str, tuple[str, ...]]:
    """The rooms and those that each imports directly, as the test declares them."""
    tree = ast.parse((ROOT / "tests/core/test_rooms.py").read_text(encoding="utf-8"))
    (table,) = (
        node.value
        for node in tree.body
        if isinstance(node, ast.AnnAssign) and getattr(node.target, "id", "") == "STANDS_ON" and node.value
    )
    rooms: dict[str, tuple[str, ...]] = ast.literal_eval(table)
    return {room: below for room, below in rooms.items() if room not in _LEFT_OUT}


def ideas() -> dict[str, str]:
    """What docs/architecture.md says of each room, up to the first comma, semicolon or colon."""
    text = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `joshua\.(\w+)` \| (.+?) \|$", text, re.MULTILINE)
    return {room: re.split(r"[,;:]", idea.replace("`", ""))[0] for room, idea in rows}


def levels(rooms: dict[str, tuple[str, ...]]) -> dict[str, int]:
    """Height of each room: one more than the highest room below it."""
    found: dict[str, int] = {}
    while len(found) < len(rooms):
        for room, below in rooms.items():
            if all(name in found for name in below):
                found.setdefault(room, max((found[name] + 1 for name in below), default=0))
    return found


def draw() -> str:
    """The picture; an arrow that a longer road replaces is left out."""
    rooms = stands_on()
    height_of = levels(rooms)
    highest = max(height_of.values())
    places: dict[str, tuple[float, float]] = {}
    for level in range(highest + 1):
        row = [room for room in rooms if height_of[room] == level]
        left = (WIDTH - len(row) * BOX[0] - (len(row) - 1) * GAP_X) / 2
        for number, room in enumerate(row):
            places[room] = (left + number * (BOX[0] + GAP_X), TOP + (highest - level) * ROW)
    height = TOP * 2 + highest * ROW + BOX[1]
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" role="img" {_FONT} '
        'aria-label="Rooms of joshua-core: an arrow points from a room to one that it imports, downwards">',
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" '
        'orient="auto"><path d="M0 0L8 4L0 8z" fill="#78909c"/></marker></defs>',
        f'<rect width="{WIDTH}" height="{height}" rx="12" fill="#fafafa"/>',
    ]
    for room, below in rooms.items():
        for name in below:
            if any(name in _below(rooms, other) for other in below):
                continue
            (x1, y1), (x2, y2) = places[room], places[name]
            lines.append(
                f'<line x1="{x1 + BOX[0] / 2:g}" y1="{y1 + BOX[1]:g}" '
                f'x2="{x2 + BOX[0] / 2:g}" y2="{y2 - 2:g}" '
                'stroke="#90a4ae" stroke-width="1.3" marker-end="url(#tip)"/>'
            )
    said = ideas()
    for room, (x, y) in places.items():
        middle = x + BOX[0] / 2
        lines += [
            f'<rect x="{x:g}" y="{y:g}" width="{BOX[0]}" height="{BOX[1]}" rx="8" fill="#e3f2fd" '
            f'stroke="#b0bec5"><title>{escape(said[room])}</title></rect>',
            f'<text x="{middle:g}" y="{y + 28:g}" text-anchor="middle" font-size="15" font-weight="600" '
            f'fill="#263238">{room}</text>',
        ]
    return "\n".join([*lines, "</svg>", ""])


def _below(rooms: dict[str, tuple[str, ...]], room: str) -> set[str]:
    found: set[str] = set()
    waiting = list(rooms[room])
    while waiting:
        if (name := waiting.pop()) not in found:
            found.add(name)
            waiting += rooms[name]
    return found


if __name__ == "__main__":
    PICTURE.write_text(draw(), encoding="utf-8")
    sys.stdout.write(f"{PICTURE.relative_to(ROOT)}\n")

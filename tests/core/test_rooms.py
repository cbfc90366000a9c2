"""The rooms of the core and the arrows between them: who may import whom (docs/architecture.md)."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import joshua
import pytest

SOURCE = Path(joshua.__file__).parent

# Each room and the rooms that it stands on; what those stand on may be imported too.
STANDS_ON: dict[str, tuple[str, ...]] = {
    "schema": (),
    "plan": ("schema",),
    "textproto": ("schema", "plan"),
    "config": ("textproto",),
    "plugins": ("schema", "plan"),
    "features": ("schema", "plan"),
    "messages": ("schema", "plan"),
    "ipc": ("plan",),
    "transport": ("messages", "plugins", "ipc"),
    "node": ("transport", "plugins", "ipc", "guardian"),
    # The process beside an actuator, the driver's link to it, and the judge of silence.
    "guardian": ("ipc",),
    "devices": ("node",),
    "models": ("plugins", "features"),
    "modes": ("config", "plugins"),
    "planner": ("modes", "config", "plugins", "features", "transport"),
    "supervisor": ("plan", "transport", "ipc", "guardian", "config"),
    "cli": ("planner", "supervisor", "models", "devices"),
    "testing": ("cli",),
    # What editors, dashboards, scripts and the commands of plugins use.
    "tools": ("cli",),
    # Public names, imported at their first use.
    "api": ("cli",),
    # The entry point of the core's own plugin: data that points at devices and models by name.
    "builtin_plugin": ("plugins",),
    # What `python -m joshua` runs.
    "__main__": ("cli",),
}


def rooms_below(room: str) -> set[str]:
    found: set[str] = set()
    waiting = list(STANDS_ON[room])
    while waiting:
        below = waiting.pop()
        if below not in found:
            found.add(below)
            waiting += STANDS_ON[below]
    return found


def imports(path: Path) -> Iterator[tuple[int, str]]:
    """Yields line and dotted name of every import of the core, those for type checkers included."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield node.lineno, alias.name
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.lineno, node.module
            if node.module == "joshua":
                yield from ((node.lineno, f"joshua.{alias.name}") for alias in node.names)


def modules() -> list[Path]:
    return [path for path in SOURCE.rglob("*.py") if not path.stem.endswith("_pb2")]


def test_every_room_is_known():
    rooms = {path.relative_to(SOURCE).parts[0].removesuffix(".py") for path in modules()}
    assert rooms - {"__init__"} <= set(STANDS_ON)


def test_no_room_stands_on_itself():
    assert [room for room in STANDS_ON if room in rooms_below(room)] == []


@pytest.mark.parametrize("room", STANDS_ON)
def test_a_room_imports_only_from_the_rooms_below_it(room: str):
    allowed = rooms_below(room) | {room}
    wrong = [
        f"{path.relative_to(SOURCE)}:{line}: {name}"
        for path in modules()
        if path.relative_to(SOURCE).parts[0].removesuffix(".py") == room
        for line, name in imports(path)
        if name.startswith("joshua.") and name.split(".")[1] not in allowed
    ]
    assert wrong == []


def test_the_core_imports_no_plugin():
    wrong = [
        f"{path.relative_to(SOURCE)}:{line}: {name}"
        for path in modules()
        for line, name in imports(path)
        if name.startswith("joshua_")
    ]
    assert wrong == []

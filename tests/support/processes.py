"""Finds processes of a run by their parent, from ``/proc``."""

from __future__ import annotations

from pathlib import Path


def parent_of(process_id: int) -> int:
    """Process id of the parent; 0 where the process is gone or a zombie."""
    try:
        state, parent = Path(f"/proc/{process_id}/stat").read_text().rpartition(")")[2].split()[:2]
    except OSError:
        return 0
    return 0 if state == "Z" else int(parent)


def children_of(process_id: int) -> list[int]:
    """Live children of a process."""
    numbers = [int(path.name) for path in Path("/proc").iterdir() if path.name.isdigit()]
    return [number for number in numbers if parent_of(number) == process_id]


def descendants_of(process_id: int) -> list[int]:
    """Live children of a process, and theirs."""
    found = []
    for child in children_of(process_id):
        found += [child, *descendants_of(child)]
    return found


def title_of(process_id: int) -> str:
    """Name of a process, as ``ps`` shows it."""
    try:
        return Path(f"/proc/{process_id}/comm").read_text().strip()
    except OSError:
        return ""


def is_guardian(process_id: int) -> bool:
    """Whether a process is the guardian of an actuator."""
    try:
        return b"joshua.guardian.main" in Path(f"/proc/{process_id}/cmdline").read_bytes()
    except OSError:
        return False

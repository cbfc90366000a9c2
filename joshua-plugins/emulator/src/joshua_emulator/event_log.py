"""Log of the emulator's events with times, as ground truth for measurements."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from typing import Any

CAPACITY = 50_000  # entries, some 20 MB; the oldest go first


class EventLog:
    """Numbered entries; each carries ``sequence``, ``event`` and ``t_ns`` (monotonic clock)."""

    def __init__(self) -> None:
        self._entries: deque[dict[str, Any]] = deque(maxlen=CAPACITY)
        self._next = 1
        self._lateness_s: deque[float] = deque(maxlen=CAPACITY)
        self.reads = 0

    def add(self, event: str, t_s: float, **values: Any) -> None:
        """Add one entry at a time of the monotonic clock, in seconds."""
        self._entries.append({"sequence": self._next, "event": event, "t_ns": round(t_s * 1e9), **values})
        self._next += 1

    def delivered(self, lateness_s: float) -> None:
        """Count one reply that the host could see ``lateness_s`` after its wire time."""
        self._lateness_s.append(lateness_s)

    def since(self, sequence: int, events: Iterable[str] = (), limit: int = CAPACITY) -> list[dict[str, Any]]:
        """Return entries after ``sequence``, optionally only of the given events, oldest first."""
        wanted = set(events)
        found = [
            entry
            for entry in self._entries
            if entry["sequence"] > sequence and (not wanted or entry["event"] in wanted)
        ]
        return found[:limit]

    def lateness(self, *, clear: bool = False) -> dict[str, float]:
        """Return the lateness of replies: count, and mean, median, p99 and maximum in seconds."""
        ordered = sorted(self._lateness_s)
        if clear:
            self._lateness_s.clear()
        if not ordered:
            return {"count": 0, "mean_s": 0.0, "median_s": 0.0, "p99_s": 0.0, "max_s": 0.0}
        return {
            "count": len(ordered),
            "mean_s": sum(ordered) / len(ordered),
            "median_s": ordered[len(ordered) // 2],
            "p99_s": ordered[min(len(ordered) - 1, int(len(ordered) * 0.99))],
            "max_s": ordered[-1],
        }

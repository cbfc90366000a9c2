"""Tracks held keys: by their releases if the terminal reports them, else by time."""

from __future__ import annotations

from joshua_teleop_input.key_decoder import KeyEvent, Kind

#: With release reports, held keys also repeat; no event for this time means that reports are lost.
SILENCE_LIMIT_S = 1.0


class KeyTracker:
    """Follows key events.

    Args:
        hold_s: time after its last event at which a key counts as released, without release reports.
    """

    def __init__(self, hold_s: float) -> None:
        self.reports_releases = False
        self._hold_s = hold_s
        self._held: dict[str, tuple[str, float]] = {}
        self._heard_s = 0.0

    def take(self, event: KeyEvent, now_s: float) -> None:
        """Process an event."""
        self._heard_s = now_s
        if event.kind in (Kind.PRESS, Kind.REPEAT):
            self._held[event.identity] = (event.key, now_s)
        elif event.kind is Kind.RELEASE:
            self._held.pop(event.identity, None)
        elif event.kind is Kind.FOCUS_LOST:
            self._held.clear()

    def held(self, now_s: float) -> frozenset[str]:
        """Return the names of the held keys."""
        if self.reports_releases:
            if now_s - self._heard_s > SILENCE_LIMIT_S:
                self._held.clear()
        else:
            for identity in [key for key, (_, at_s) in self._held.items() if now_s - at_s > self._hold_s]:
                del self._held[identity]
        return frozenset(name for name, _ in self._held.values())

    def release_all(self) -> None:
        """Treat every key as released."""
        self._held.clear()

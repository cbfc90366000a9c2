"""A clock that stands still unless a test lets it go on, however busy the machine is."""

from __future__ import annotations

import time


class SteppedTime:
    """Takes the place of the module ``time`` in a module under test: time passes only where it sleeps."""

    def __init__(self) -> None:
        self._monotonic_ns = time.monotonic_ns()
        self._epoch_ns = time.time_ns() - self._monotonic_ns

    def monotonic_ns(self) -> int:
        """As ``time.monotonic_ns``."""
        return self._monotonic_ns

    def monotonic(self) -> float:
        """As ``time.monotonic``."""
        return self._monotonic_ns / 1e9

    def time_ns(self) -> int:
        """As ``time.time_ns``."""
        return self._epoch_ns + self._monotonic_ns

    def sleep(self, seconds: float) -> None:
        """Lets time pass at once."""
        self._monotonic_ns += round(seconds * 1e9)

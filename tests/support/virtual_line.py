"""The line between a servo bus and emulated servos, in virtual time."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

from stepped_time import SteppedTime

STRANGER = 9


class Line:
    """The line of an emulated bus, in virtual time; what a bus needs of a serial port."""

    def __init__(self, emulated: Any, clock: SteppedTime, stranger: Any = None) -> None:
        self.baudrate = 1_000_000
        self.fates: Iterator[tuple[str, float]] = iter(())
        self._emulated = emulated
        self._clock = clock
        self._stranger = stranger
        self._coming: list[tuple[float, int, bytes]] = []
        self._order = itertools.count()

    def __str__(self) -> str:
        return "line"

    def set_baudrate(self, baudrate: int) -> None:
        """As that of a serial port."""
        self.baudrate = baudrate

    def wire_time_s(self, size: int) -> float:
        """As that of a serial port."""
        return size * 10 / self.baudrate

    def send(self, data: bytes) -> None:
        """Drops what has come, and sends; each reply meets its fate."""
        now_s = self._clock.monotonic()
        self._coming = [entry for entry in self._coming if entry[0] > now_s]
        fates = list(itertools.islice(self.fates, 4))
        if ("request lost", 0.0) in fates:
            return
        fate = iter(fates)
        for reply in self._emulated.receive(data, self.baudrate, now_s):
            kind, late_s = next(fate, ("good", 0.0))
            if kind == "foreign":
                self._put(reply.due_s, self._stranger(STRANGER, 0, bytes(len(reply.data) - 6)))
            if kind != "lost":
                self._put(reply.due_s + late_s, reply.data)
            if kind == "twice":
                self._put(reply.due_s + self.wire_time_s(len(reply.data)), reply.data)

    def receive(self, size: int, deadline_s: float) -> bytes:
        """Lets time pass until the bytes are there, or the deadline is."""
        data = b""
        while len(data) < size:
            self._coming.sort()
            now_s = self._clock.monotonic()
            if self._coming and self._coming[0][0] <= max(now_s, deadline_s):
                due_s, order, chunk = self._coming.pop(0)
                self._clock.sleep(max(0.0, due_s - now_s))
                wanted = size - len(data)
                data += chunk[:wanted]
                if chunk[wanted:]:
                    self._coming.append((due_s, order, chunk[wanted:]))
            else:
                self._clock.sleep(max(0.0, deadline_s - now_s) + 1e-6)
                break
        return data

    def _put(self, due_s: float, data: bytes) -> None:
        self._coming.append((due_s, next(self._order), data))

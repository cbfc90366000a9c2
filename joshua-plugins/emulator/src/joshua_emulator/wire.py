"""Timing of bytes on a half-duplex line: 8N1, ten bits per byte."""

from __future__ import annotations

from dataclasses import dataclass

BITS_PER_BYTE = 10  # start bit, eight data bits, stop bit


@dataclass(frozen=True, order=True)
class TimedReply:
    """Bytes that the host may see from ``due_s`` (monotonic clock, s) on: the end of their last stop bit."""

    due_s: float
    sequence: int
    data: bytes


class WireClock:
    """Time line of one half-duplex bus; all times are monotonic, in seconds."""

    def __init__(self) -> None:
        self._free_s = 0.0

    def request(self, size: int, baudrate: int, now_s: float) -> float:
        """Take ``size`` bytes from the host. Return when the last one has left the line."""
        start_s = max(now_s, self._free_s)
        self._free_s = start_s + size * BITS_PER_BYTE / baudrate
        return self._free_s

    def reply(self, size: int, baudrate: int, delay_s: float) -> float:
        """Take ``size`` bytes of a device that waits ``delay_s``. Return when the last one has left."""
        self._free_s += delay_s + size * BITS_PER_BYTE / baudrate
        return self._free_s

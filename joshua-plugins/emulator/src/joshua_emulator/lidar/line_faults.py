"""Faults on a scanner's line: lost packets, changed bytes, noise before the next packet."""

from __future__ import annotations

import random
from typing import Any


class LineFaultError(ValueError):
    """An unknown fault or an invalid value. The message lists what is allowed."""


class LineFaults:
    """Probabilities of faults, initially 0.

    ``drop`` loses a packet; ``corrupt`` changes a byte: it is the probability of each byte.
    """

    KINDS = ("drop", "corrupt")

    def __init__(self, seed: int = 0) -> None:
        self._random = random.Random(seed)  # noqa: S311 - reproducible faults, no secrets
        self._probability = dict.fromkeys(self.KINDS, 0.0)
        self.counts = dict.fromkeys(self.KINDS, 0)
        self._noise = b""

    def set(self, kind: str, probability: Any) -> None:
        """Set the probability of a kind. Raises LineFaultError."""
        number = isinstance(probability, (int, float)) and not isinstance(probability, bool)
        if not number or not 0 <= probability <= 1:
            raise LineFaultError(f"{kind} is {probability!r}; allowed: a probability from 0 to 1")
        self._probability[kind] = float(probability)

    def begin_dirty(self, noise_bytes: int) -> None:
        """Put noise and the rest of a packet before the next one."""
        self._noise = self._random.randbytes(noise_bytes)

    def clear(self) -> None:
        """Clear all faults; keep the counts."""
        self._probability = dict.fromkeys(self.KINDS, 0.0)
        self._noise = b""

    def describe(self) -> dict[str, float]:
        """Return the present probabilities."""
        return dict(self._probability)

    def drops(self) -> bool:
        """Draw whether a packet is lost."""
        lost = self._random.random() < self._probability["drop"]
        self.counts["drop"] += lost
        return lost

    def disturb(self, packet: bytes) -> bytes:
        """Apply random faults to a packet and return it as sent."""
        if self._noise:
            packet, self._noise = self._noise + packet[len(packet) // 2 :], b""
        share = self._probability["corrupt"]
        if share <= 0:
            return packet
        damaged = bytearray(packet)
        for place in range(len(damaged)):
            if self._random.random() < share:
                damaged[place] ^= self._random.randrange(1, 256)
                self.counts["corrupt"] += 1
        return bytes(damaged)

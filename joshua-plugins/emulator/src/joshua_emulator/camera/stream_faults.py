"""Faults of a camera's frames: lost, damaged and cut off, drawn from a seeded generator."""

from __future__ import annotations

import random
from typing import Any

_FLIPPED_BYTES = 12
_HEADER_SHARE = 50  # the first fiftieth of a frame stays whole: its tables and its first blocks


class StreamFaultError(ValueError):
    """An unknown fault or an invalid value. The message lists what is allowed."""


class StreamFaults:
    """Probabilities of faults, initially 0, and their effect on frames.

    ``drop`` loses a frame before it is sent, ``corrupt`` changes bytes of its picture, ``truncate`` cuts the
    picture in half, with a matching content length.
    """

    KINDS = ("drop", "corrupt", "truncate")

    def __init__(self, seed: int = 0) -> None:
        self._random = random.Random(seed)  # noqa: S311 - reproducible faults, no secrets
        self._probability = dict.fromkeys(self.KINDS, 0.0)
        self.counts = dict.fromkeys(self.KINDS, 0)

    def set(self, kind: str, probability: Any) -> None:
        """Set the probability of a kind. Raises StreamFaultError."""
        number = isinstance(probability, (int, float)) and not isinstance(probability, bool)
        if not number or not 0 <= probability <= 1:
            raise StreamFaultError(f"{kind} is {probability!r}; allowed: a probability from 0 to 1")
        self._probability[kind] = float(probability)

    def clear(self) -> None:
        """Clear all faults; keep the counts."""
        self._probability = dict.fromkeys(self.KINDS, 0.0)

    def describe(self) -> dict[str, float]:
        """Return the present probabilities."""
        return dict(self._probability)

    def drops(self) -> bool:
        """Draw whether a frame is lost."""
        return self._draw("drop")

    def disturb(self, frame: bytes) -> bytes:
        """Apply random faults to a frame and return it as sent."""
        if self._draw("corrupt"):
            damaged = bytearray(frame)
            for _ in range(_FLIPPED_BYTES):
                place = self._random.randrange(len(frame) // _HEADER_SHARE, len(frame) - 2)
                damaged[place] ^= self._random.randrange(1, 256)
            frame = bytes(damaged)
        if self._draw("truncate"):
            frame = frame[: len(frame) // 2]
        return frame

    def _draw(self, kind: str) -> bool:
        probability = self._probability[kind]
        if probability <= 0.0 or self._random.random() >= probability:
            return False
        self.counts[kind] += 1
        return True

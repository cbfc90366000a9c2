"""Line faults: lost, corrupt and late packets, from a seeded generator."""

from __future__ import annotations

import random
from collections.abc import Mapping
from typing import Any

LATE_BY_S = 0.02  # how late a late reply is where the fault does not say


class FaultError(ValueError):
    """An unknown fault or an invalid value. The message lists what is allowed."""


class Faults:
    """Probabilities of line faults, initially 0.

    ``drop`` loses a reply, ``drop_request`` an instruction, ``corrupt`` flips one bit of a reply, ``late``
    hands a reply over ``late_by_s`` after its time.
    """

    KINDS = ("drop", "drop_request", "corrupt", "late")

    def __init__(self, seed: int = 0) -> None:
        self._random = random.Random(seed)  # noqa: S311 - reproducible faults, no secrets
        self._probability = dict.fromkeys(self.KINDS, 0.0)
        self.late_by_s = LATE_BY_S
        self.counts = dict.fromkeys(self.KINDS, 0)

    def set(self, values: Mapping[str, Any]) -> None:
        """Set probabilities by kind, and ``late_by_s``. Raises FaultError and then changes nothing."""
        for kind, value in values.items():
            if kind not in (*self.KINDS, "late_by_s"):
                allowed = ", ".join((*self.KINDS, "late_by_s"))
                raise FaultError(f"unknown line fault {kind!r}; allowed: {allowed}")
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 <= value <= 1:
                what = "seconds" if kind == "late_by_s" else "a probability"
                raise FaultError(f"{kind} is {value!r}; allowed: {what} from 0 to 1")
        for kind, value in values.items():
            if kind == "late_by_s":
                self.late_by_s = float(value)
            else:
                self._probability[kind] = float(value)

    def clear(self) -> None:
        """Clear all line faults; keep the counts."""
        self._probability = dict.fromkeys(self.KINDS, 0.0)
        self.late_by_s = LATE_BY_S

    def describe(self) -> dict[str, float]:
        """Probabilities in force, and ``late_by_s``."""
        return {**self._probability, "late_by_s": self.late_by_s}

    def loses_request(self) -> bool:
        """Draw whether an instruction is lost."""
        return self._draw("drop_request")

    def disturb(self, data: bytes) -> tuple[bytes, float] | None:
        """Apply random faults to a reply: return None if lost, else its bytes and its delay in seconds."""
        if self._draw("drop"):
            return None
        if self._draw("corrupt"):
            damaged = bytearray(data)
            damaged[self._random.randrange(len(data))] ^= 1 << self._random.randrange(8)
            data = bytes(damaged)
        return data, self.late_by_s if self._draw("late") else 0.0

    def _draw(self, kind: str) -> bool:
        probability = self._probability[kind]
        if probability <= 0.0 or self._random.random() >= probability:
            return False
        self.counts[kind] += 1
        return True

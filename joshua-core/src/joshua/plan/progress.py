"""The progress of a node's work, the only event that nodes make."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Progress:
    """Progress of a node's finite work.

    Attributes:
        name: of the work; current: finished work in ``unit``; total: all of it, None if unknown.
        rate: units per second, so far; remaining_s: time to the end. None if unknown.
    """

    node: str
    name: str
    current: float
    total: float | None = None
    unit: str = ""
    rate: float | None = None
    remaining_s: float | None = None

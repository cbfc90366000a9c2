"""The state of a servo from one read, in common units."""

from __future__ import annotations

from typing import NamedTuple


class Feedback(NamedTuple):
    """The state of a servo. ``load`` is a fraction of stall torque, signed like ``speed``."""

    position: int  # ticks
    speed: float  # ticks/s
    load: float
    voltage_v: float
    temperature_c: int
    status: int  # see StatusBits
    moving: bool
    current_a: float

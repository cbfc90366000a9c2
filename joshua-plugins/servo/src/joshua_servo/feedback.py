"""What one read of a servo's state brings, in the units of all families."""

from __future__ import annotations

from typing import NamedTuple


class Feedback(NamedTuple):
    """What a servo says of itself; ``load`` is a fraction of stall torque, signed like ``speed``."""

    position: int  # ticks
    speed: float  # ticks/s
    load: float
    voltage_v: float
    temperature_c: int
    status: int  # see StatusBits
    moving: bool
    current_a: float

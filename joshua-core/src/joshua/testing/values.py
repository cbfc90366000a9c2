"""Clauses about values: arrays of the right type and shape, in SI units."""

from __future__ import annotations

import numpy as np

from joshua.testing.conformance import require

#: Positions beyond this are ticks or degrees, not radians: no joint here turns sixteen times.
PLAUSIBLE_RAD = 100.0
PLAUSIBLE_RAD_S = 1000.0

#: How far a joint may be from where it should be: the play of a gear and the load of an arm.
POSITION_TOLERANCE_RAD = 0.1

#: Largest step of a device's position, such as one tick.
RESOLUTION_RAD = 0.02


def check_array(label: str, value: object, count: int) -> None:
    """A value is a finite float64 array of shape (count,)."""
    require(
        isinstance(value, np.ndarray) and value.dtype == np.float64,
        f"{label} is {type(value).__name__}"
        + (f" of {value.dtype}" if isinstance(value, np.ndarray) else ""),
        why="arrays of float64 pass from the device to the message without conversion",
        cause="a list or an array of integers, perhaps of ticks, is handed out",
    )
    assert isinstance(value, np.ndarray)
    require(
        value.shape == (count,),
        f"{label} has shape {value.shape}; {count} joints need ({count},)",
        why="each joint has one value, in joint order",
        cause="joints are missing from the answer, or a dimension is too many",
    )
    require(
        bool(np.isfinite(value).all()),
        f"{label} is {value.tolist()}",
        why="a value that is not finite spreads through every computation",
        cause="a failed reading is filled with NaN in place of raising an error",
    )


def check_plausible(observed: str, value: float, bound: float) -> None:
    """A value is small enough to be in SI units."""
    require(
        value <= bound,
        observed,
        why="SI units and radians hold at every boundary",
        cause="ticks, degrees or a vendor's unit are handed out without conversion",
    )

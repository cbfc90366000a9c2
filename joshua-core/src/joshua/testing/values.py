"""Clauses about values: arrays of the right type and shape in SI units, stamps, messages."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from joshua.messages import encode, known_types
from joshua.testing.conformance import must

#: Positions beyond this are ticks or degrees, not radians: no joint makes sixteen turns.
PLAUSIBLE_RAD = 100.0
PLAUSIBLE_RAD_S = 1000.0

#: Tolerance of a position: gear backlash and the load of the arm.
POSITION_TOLERANCE_RAD = 0.1

#: Largest step of a device's position, such as one tick.
RESOLUTION_RAD = 0.02

#: Largest distance between a stamp and the clock of this machine.
STAMP_TOLERANCE_NS = 60 * 1_000_000_000

FRAME = "frame_of_the_test"


def check_array(label: str, value: object, count: int) -> None:
    """A value is a finite float64 array of shape (count,)."""
    must("array.kind", isinstance(value, np.ndarray) and value.dtype == np.float64, label, kind_of(value))
    assert isinstance(value, np.ndarray)
    must("array.shape", value.shape == (count,), label, value.shape, count)
    must("array.finite", bool(np.isfinite(value).all()), label, value.tolist())


def kind_of(value: object) -> str:
    """Return the type of a value, with that of an array's elements."""
    name = type(value).__name__
    return f"{name} of {value.dtype}" if isinstance(value, np.ndarray) else name


def check_plausible(label: str, values: Any, bound: float, unit: str) -> None:
    """Values are plausible in SI units."""
    largest = float(np.abs(values).max())
    must("plausible", largest <= bound, label, largest, unit)


def check_stamps(next_stamp_ns: Callable[[], object], count: int) -> None:
    """Stamps are ns since the epoch, at acquisition, and increase."""
    last_ns = 0
    for _ in range(count):
        before_ns = time.time_ns()
        stamp_ns = next_stamp_ns()
        after_ns = time.time_ns()
        must("stamp.type", type(stamp_ns) is int, stamp_ns, type(stamp_ns).__name__)
        assert isinstance(stamp_ns, int)
        near = before_ns - STAMP_TOLERANCE_NS <= stamp_ns <= after_ns + STAMP_TOLERANCE_NS
        must("stamp.epoch", near, stamp_ns, after_ns)
        must("stamp.ahead", stamp_ns <= after_ns + 1_000_000, (stamp_ns - after_ns) / 1e6)
        must("stamp.order", stamp_ns > last_ns, last_ns, stamp_ns)
        last_ns = stamp_ns


def check_types(label: str, types: Sequence[str]) -> None:
    """ROS 2 knows every type."""
    for name in types:
        must("types.unknown", name in known_types(), label, name)


def check_message(message: Any, type_name: str, source: str) -> None:
    """A message has the requested type and frame, and can be encoded."""
    made = getattr(message, "__msgtype__", type(message).__name__)
    must("message.type", made == type_name, source, made, type_name)
    encode(message)
    frame_id = getattr(getattr(message, "header", None), "frame_id", FRAME)
    must("message.frame", frame_id == FRAME, type_name, frame_id)

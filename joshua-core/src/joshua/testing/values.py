"""Clauses about values: arrays of the right type and shape in SI units, stamps, messages."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from joshua.messages import encode, known_types
from joshua.testing.conformance import require

#: Positions beyond this are ticks or degrees, not radians: no joint here turns sixteen times.
PLAUSIBLE_RAD = 100.0
PLAUSIBLE_RAD_S = 1000.0

#: How far a joint may be from where it should be: the play of a gear and the load of an arm.
POSITION_TOLERANCE_RAD = 0.1

#: Largest step of a device's position, such as one tick.
RESOLUTION_RAD = 0.02

#: Largest distance between a stamp and the clock of this machine.
STAMP_TOLERANCE_NS = 60 * 1_000_000_000

FRAME = "frame_of_the_test"


def check_array(label: str, value: object, count: int) -> None:
    """A value is a finite float64 array of shape (count,)."""
    kind = type(value).__name__ + (f" of {value.dtype}" if isinstance(value, np.ndarray) else "")
    require(
        isinstance(value, np.ndarray) and value.dtype == np.float64,
        f"{label} is {kind}",
        "a list or an array of integers is returned, perhaps of ticks",
        "the node passes float64 arrays from device to message without conversion",
    )
    assert isinstance(value, np.ndarray)
    require(
        value.shape == (count,),
        f"{label} has shape {value.shape}; {count} joints need ({count},)",
        "joints are missing from the reply, or the array has another dimension",
        "each joint has one value, in joint order",
    )
    require(
        bool(np.isfinite(value).all()),
        f"{label} is {value.tolist()}",
        "the driver fills in NaN where it should raise an error",
        "a value that is not finite spoils every computation",
    )


def check_plausible(observed: str, value: float, bound: float) -> None:
    """A value is small enough to be in SI units."""
    cause = "ticks, degrees or a vendor's unit are returned without conversion"
    require(value <= bound, observed, cause, "SI units and radians hold at every boundary")


def check_stamps(next_stamp_ns: Callable[[], object], count: int) -> None:
    """Stamps are ns since the epoch, at acquisition, and increase."""
    last_ns = 0
    for _ in range(count):
        before_ns = time.time_ns()
        stamp_ns = next_stamp_ns()
        after_ns = time.time_ns()
        require(
            isinstance(stamp_ns, int) and not isinstance(stamp_ns, bool),
            f"stamp_ns is {stamp_ns!r} of type {type(stamp_ns).__name__}",
            "time.time() is used instead of time.time_ns()",
            "a float cannot hold nanoseconds since the epoch exactly",
        )
        assert isinstance(stamp_ns, int)
        require(
            before_ns - STAMP_TOLERANCE_NS <= stamp_ns <= after_ns + STAMP_TOLERANCE_NS,
            f"stamp_ns is {stamp_ns}, while the clock shows {after_ns}",
            "seconds, milliseconds or the monotonic clock are used instead of time.time_ns()",
            "data of all nodes are matched by stamps in nanoseconds since the epoch",
        )
        require(
            stamp_ns <= after_ns + 1_000_000,
            f"stamp_ns is {(stamp_ns - after_ns) / 1e6:.1f} ms after the return of read",
            "the stamp is computed ahead, or comes from a clock that drifts from this machine's",
            "an acquisition is never later than its result",
        )
        require(
            stamp_ns > last_ns,
            f"stamp_ns went from {last_ns} to {stamp_ns}",
            "the stamp is kept from connect, a stored reading is returned again, or a clock is set back",
            "each reading is an acquisition of its own, later than the one before",
        )
        last_ns = stamp_ns


def check_types(label: str, types: Sequence[str]) -> None:
    """ROS 2 knows every type."""
    unknown = [name for name in types if name not in known_types()]
    require(
        not unknown,
        f"{label} names {unknown[0] if unknown else ''}, which is not a ROS 2 type",
        "the name lacks /msg/, or is the enum name of the configuration file",
        "a topic has a ROS 2 type such as sensor_msgs/msg/Image",
    )


def check_message(message: Any, type_name: str, source: str) -> None:
    """A message has the type and the frame that were asked for, and can be encoded."""
    made = getattr(message, "__msgtype__", type(message).__name__)
    require(
        made == type_name,
        f"{source} made {made} instead of {type_name}",
        f"{source} ignores type_name, or has nothing to send after the first reading",
        "the topic carries the type that the configuration names",
    )
    encode(message)
    header = getattr(message, "header", None)
    require(
        header is None or header.frame_id == FRAME,
        f"{type_name} has frame_id {getattr(header, 'frame_id', '')!r}",
        f"{source} does not use its argument frame_id",
        "the configuration names the frame of the data",
    )

"""Measurements as returned by the parsers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.floating[Any]]
Offsets = npt.NDArray[np.int64]

MM = 0.001


@dataclass(frozen=True)
class Samples:
    """Measurements in the order in which they were taken; all arrays have one length.

    Attributes:
        angle_rad: direction, counter-clockwise from above, 0 at the scanner's zero mark (REP 103);
            not reduced to one turn.
        range_m: distance; NaN if the scanner reports no measurement.
        intensity: of the echo in the scanner's own scale; NaN if not sent.
        end: stream offset of the end of the packet that contained the measurement.
    """

    angle_rad: Floats
    range_m: Floats
    intensity: Floats
    end: Offsets

    def __len__(self) -> int:
        return len(self.angle_rad)


def samples_of(clockwise_rad: Floats, range_m: Floats, intensity: Floats | None, end: Offsets) -> Samples:
    """Return samples of a clockwise scanner that reports 0 for missing measurements."""
    measured = np.where(range_m > 0, range_m, np.nan)
    if intensity is None:
        intensity = np.full(len(measured), np.nan)
    return Samples(-clockwise_rad, measured, intensity, end)


NOTHING = Samples(np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(0, np.int64))


def joined(parts: Sequence[Samples]) -> Samples:
    """Concatenate samples."""
    if len(parts) == 1:
        return parts[0]
    if not parts:
        return NOTHING
    return Samples(
        np.concatenate([part.angle_rad for part in parts]),
        np.concatenate([part.range_m for part in parts]),
        np.concatenate([part.intensity for part in parts]),
        np.concatenate([part.end for part in parts]),
    )


class Parser(Protocol):
    """Turns a stream of bytes, in pieces of any size, into measurements."""

    @property
    def packets(self) -> int:
        """Packets accepted so far."""

    @property
    def damaged(self) -> int:
        """Number of places so far where stray bytes or a broken packet were skipped."""

    def feed(self, data: bytes) -> Samples:
        """Add bytes; return the measurements that they complete."""

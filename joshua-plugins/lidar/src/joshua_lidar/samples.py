"""Measurements as the parsers hand them on."""

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
        angle_rad: direction, counter-clockwise seen from above, 0 at the scanner's own zero mark (REP 103);
            not reduced to one turn.
        range_m: distance; NaN if the scanner says that it measured nothing.
        intensity: of the echo in the scanner's own scale; NaN if it sends none.
        end: bytes of the stream up to the end of the packet that brought the measurement.
    """

    angle_rad: Floats
    range_m: Floats
    intensity: Floats
    end: Offsets

    def __len__(self) -> int:
        return len(self.angle_rad)


def samples_of(clockwise_rad: Floats, range_m: Floats, intensity: Floats | None, end: Offsets) -> Samples:
    """Make samples of a scanner that turns clockwise and give 0 for distances that it did not measure."""
    measured = np.where(range_m > 0, range_m, np.nan)
    if intensity is None:
        intensity = np.full(len(measured), np.nan)
    return Samples(-clockwise_rad, measured, intensity, end)


NOTHING = Samples(np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(0, np.int64))


def joined(parts: Sequence[Samples]) -> Samples:
    """Several samples as one."""
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
        """Packets that were accepted so far."""

    @property
    def damaged(self) -> int:
        """Place so far at which bytes between packets, or a broken packet, were left out."""

    def feed(self, data: bytes) -> Samples:
        """Take the next bytes; return the measurements that are complete with them."""

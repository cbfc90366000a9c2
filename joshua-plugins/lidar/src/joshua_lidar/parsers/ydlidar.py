"""YDLIDAR X2 and X4: packets of 1 to 255 distances between two angles, with an XOR of 16-bit words.

The laser is offset from the axis, so each angle is corrected by an amount that depends on the distance.
"""

from __future__ import annotations

import re

import numpy as np

from joshua_lidar.framing import TRUST_RUN, PacketFinder
from joshua_lidar.samples import MM, NOTHING, Floats, Samples, samples_of

HEAD = 10

#: Largest correction of an angle, in radians, for distances that these scanners measure.
LARGEST_CORRECTION_RAD = 0.14

_HEADER = re.compile(rb"\xaa\x55")
_UNITS = 360 * 64  # of an angle in a turn
_QUARTER_MM = MM / 4
_LASER_MM, _BASE_MM = 21.8, 155.3


class _Finder(PacketFinder):
    def length(self, buffer: bytes, start: int) -> int:
        count = buffer[start + 3]
        # both angles carry a check bit
        good = count and buffer[start + 4] & 1 and buffer[start + 6] & 1
        return HEAD + 2 * count if good else 0

    def valid(self, packet: bytes) -> bool:
        words = np.frombuffer(packet, "<u2")
        return not np.bitwise_xor.reduce(words) and words[2] >> 1 < _UNITS and words[3] >> 1 < _UNITS


class YdlidarParser:
    """Parser of the YDLIDAR X2 and X4."""

    def __init__(self, trust_run: int = TRUST_RUN) -> None:
        self._finder = _Finder(_HEADER, HEAD, trust_run)

    @property
    def packets(self) -> int:
        """Packets accepted so far."""
        return self._finder.packets

    @property
    def damaged(self) -> int:
        """Skipped parts of the stream so far."""
        return self._finder.damaged

    def feed(self, data: bytes) -> Samples:
        """Add bytes; return the measurements that they complete."""
        packets = self._finder.find(data)
        if not packets:
            return NOTHING
        heads = np.frombuffer(b"".join(packet.data[:HEAD] for packet in packets), "<u2").reshape(
            -1, HEAD // 2
        )
        quarters = np.frombuffer(b"".join(packet.data[HEAD:] for packet in packets), "<u2")
        count = (heads[:, 1] >> 8).astype(np.int64)
        first, last = (heads[:, 2] >> 1).astype(np.int64), (heads[:, 3] >> 1).astype(np.int64)
        step = np.where(count > 1, (last - first) % _UNITS / np.maximum(count - 1, 1), 0.0)
        number = np.arange(len(quarters)) - np.repeat(np.cumsum(count) - count, count)
        angle = np.radians((np.repeat(first, count) + np.repeat(step, count) * number) / 64)
        range_m = quarters * _QUARTER_MM
        end = np.repeat(np.array([packet.end for packet in packets]), count)
        return samples_of(angle + correction_rad(range_m), range_m, None, end)


def correction_rad(range_m: Floats) -> Floats:
    """Return the angle correction, clockwise positive, for the laser's offset from the axis."""
    mm = np.where(range_m > 0, range_m / MM, _BASE_MM)  # nothing measured: nothing to correct
    return np.arctan(_LASER_MM * (_BASE_MM - mm) / (_BASE_MM * mm))

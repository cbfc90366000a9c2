"""RPLIDAR's express scans: capsules of 84 bytes with an XOR checksum, each completed by the next one's angle.

The legacy capsule (A1) holds 32 distances, each with a correction of its angle; the dense one (C1) holds 40.
"""

from __future__ import annotations

import re
from functools import reduce
from operator import xor
from typing import Protocol

import numpy as np
import numpy.typing as npt

from joshua_lidar.framing import TRUST_RUN, Packet, PacketFinder
from joshua_lidar.samples import MM, NOTHING, Floats, Offsets, Samples, samples_of

LENGTH = 84
LEGACY_POINTS = 32
DENSE_POINTS = 40

_HEADER = re.compile(rb"[\xa0-\xaf][\x50-\x5f]")
_UNITS = 360 * 64  # of a start angle in a turn
_START_BITS = 0x7FFF  # the bit above marks the first capsule of a scan
_EIGHTH_RAD = np.radians(1 / 8)

_Rows = npt.NDArray[np.uint8]


class _Finder(PacketFinder):
    def length(self, buffer: bytes, start: int) -> int:
        return LENGTH

    def valid(self, packet: bytes) -> bool:
        checksum = packet[0] & 0x0F | (packet[1] & 0x0F) << 4
        angle = (packet[2] | packet[3] << 8) & _START_BITS
        return angle < _UNITS and reduce(xor, packet[2:]) == checksum


class _Decoder(Protocol):
    def __call__(self, rows: _Rows, start_rad: Floats, span_rad: Floats, end: Offsets) -> Samples: ...


class _CapsuleParser:
    """Completes each capsule with the start angle of its immediate successor."""

    def __init__(self, decode: _Decoder, trust_run: int) -> None:
        self._decode = decode
        self._finder = _Finder(_HEADER, 2, trust_run)
        self._waiting: Packet | None = None

    @property
    def packets(self) -> int:
        """Capsules accepted so far."""
        return self._finder.packets

    @property
    def damaged(self) -> int:
        """Skipped parts of the stream so far."""
        return self._finder.damaged

    def feed(self, data: bytes) -> Samples:
        """Add bytes; the last capsule waits for its successor."""
        packets = self._finder.find(data)
        if not packets:
            return NOTHING
        if self._waiting is not None:
            packets.insert(0, self._waiting)
        self._waiting = packets[-1]
        rows = np.frombuffer(b"".join(packet.data for packet in packets), np.uint8).reshape(-1, LENGTH)
        starts = np.array([packet.start for packet in packets])
        angle = (rows[:, 2].astype(np.int64) | rows[:, 3].astype(np.int64) << 8) & _START_BITS
        begins_anew = rows[1:, 3] & 0x80 != 0
        whole = (np.diff(starts) == LENGTH) & ~begins_anew
        if not whole.any():
            return NOTHING
        span = (np.diff(angle) % _UNITS)[whole]
        # a capsule's last measurement was taken when the capsule was sent, not when the next one came
        end = starts[:-1][whole] + LENGTH
        rad = np.radians(1 / 64)
        return self._decode(rows[:-1][whole], angle[:-1][whole] * rad, span * rad, end)


class LegacyExpressParser(_CapsuleParser):
    """Parser of the RPLIDAR A1's express scan (answer type 0x82)."""

    def __init__(self, trust_run: int = TRUST_RUN) -> None:
        super().__init__(_decode_legacy, trust_run)


class DenseExpressParser(_CapsuleParser):
    """Parser of the RPLIDAR C1's express scan (answer type 0x85)."""

    def __init__(self, trust_run: int = TRUST_RUN) -> None:
        super().__init__(_decode_dense, trust_run)


def _decode_legacy(rows: _Rows, start_rad: Floats, span_rad: Floats, end: Offsets) -> Samples:
    cabins = rows[:, 4:].reshape(len(rows), LEGACY_POINTS // 2, 5).astype(np.int64)
    first, second = cabins[..., 0] | cabins[..., 1] << 8, cabins[..., 2] | cabins[..., 3] << 8
    word = np.stack((first, second), axis=-1).reshape(len(rows), LEGACY_POINTS)
    low = np.stack((cabins[..., 4] & 0x0F, cabins[..., 4] >> 4), axis=-1).reshape(len(rows), LEGACY_POINTS)
    offset = (low | (word & 3) << 4) * _EIGHTH_RAD
    angle = _spread(start_rad, span_rad, LEGACY_POINTS) - offset
    return samples_of(angle.ravel(), (word >> 2).ravel() * MM, None, np.repeat(end, LEGACY_POINTS))


def _decode_dense(rows: _Rows, start_rad: Floats, span_rad: Floats, end: Offsets) -> Samples:
    mm = np.ascontiguousarray(rows[:, 4:]).view("<u2").astype(np.int64)
    angle = _spread(start_rad, span_rad, DENSE_POINTS)
    return samples_of(angle.ravel(), mm.ravel() * MM, None, np.repeat(end, DENSE_POINTS))


def _spread(start_rad: Floats, span_rad: Floats, points: int) -> Floats:
    spread: Floats = start_rad[:, None] + span_rad[:, None] * (np.arange(points) / points)
    return spread

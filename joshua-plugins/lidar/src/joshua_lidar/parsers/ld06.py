"""LD06 and LD19 (and the LDS-02, which is one): 47 bytes for 12 measurements, with a CRC-8."""

from __future__ import annotations

import re

import numpy as np

from joshua_lidar.framing import TRUST_RUN, PacketFinder
from joshua_lidar.samples import MM, NOTHING, Samples, samples_of

LENGTH = 47
POINTS = 12

_HEADER = re.compile(rb"\x54\x2c")
_POLYNOMIAL = 0x4D
_HUNDREDTHS = 36000  # of a degree in a turn
_LARGEST_SPAN = 9000  # of one packet, in hundredths; a stalled scanner sends the same angle again
_LAYOUT = np.dtype(
    [
        ("header", "u1", 2),
        ("speed_deg_s", "<u2"),
        ("first", "<u2"),
        ("points", [("mm", "<u2"), ("intensity", "u1")], POINTS),
        ("last", "<u2"),
        ("time_ms", "<u2"),
        ("crc", "u1"),
    ]
)


def _table() -> bytes:
    table = bytearray()
    for value in range(256):
        for _ in range(8):
            value = (value << 1 ^ _POLYNOMIAL if value & 0x80 else value << 1) & 0xFF
        table.append(value)
    return bytes(table)


_CRC = _table()


class _Finder(PacketFinder):
    def length(self, buffer: bytes, start: int) -> int:
        return LENGTH

    def valid(self, packet: bytes) -> bool:
        crc, table = 0, _CRC
        for byte in packet:
            crc = table[crc ^ byte]
        if crc:  # 0 over a packet with its CRC
            return False
        first, last = packet[4] | packet[5] << 8, packet[42] | packet[43] << 8
        return first < _HUNDREDTHS and last < _HUNDREDTHS and (last - first) % _HUNDREDTHS < _LARGEST_SPAN


class Ld06Parser:
    """Parser of the LD06 and the LD19."""

    def __init__(self, trust_run: int = TRUST_RUN) -> None:
        self._finder = _Finder(_HEADER, 2, trust_run)

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
        table = np.frombuffer(b"".join(packet.data for packet in packets), _LAYOUT)
        first = table["first"].astype(np.int64)
        span = (table["last"] - first) % _HUNDREDTHS
        share = np.arange(POINTS) / (POINTS - 1)
        angle = np.radians((first[:, None] + span[:, None] * share) / 100).ravel()
        points = table["points"]
        end = np.repeat(np.array([packet.end for packet in packets]), POINTS)
        return samples_of(angle, points["mm"].ravel() * MM, points["intensity"].ravel().astype(float), end)

"""LDS-01 (HLS-LFCD2, of the TurtleBot3): 42 bytes for 6 measurements one degree apart, with a checksum."""

from __future__ import annotations

import re

import numpy as np

from joshua_lidar.framing import TRUST_RUN, PacketFinder
from joshua_lidar.samples import MM, NOTHING, Samples, samples_of

LENGTH = 42
POINTS = 6

_HEADER = re.compile(rb"\xfa[\xa0-\xdb]")
_FIRST_INDEX = 0xA0
_LAYOUT = np.dtype(
    [
        ("sync", "u1"),
        ("index", "u1"),
        ("rpm", "<u2"),
        ("points", [("intensity", "<u2"), ("mm", "<u2"), ("reserved", "<u2")], POINTS),
        ("checksum", "u1", 2),
    ]
)


class _Finder(PacketFinder):
    def length(self, buffer: bytes, start: int) -> int:
        return LENGTH

    def valid(self, packet: bytes) -> bool:
        # sent twice: the complement of the sum of all bytes before
        return packet[40] == packet[41] == 0xFF - (sum(packet[:40]) & 0xFF)


class Lds01Parser:
    """Parser of the LDS-01."""

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
        degrees = (table["index"].astype(np.int64) - _FIRST_INDEX)[:, None] * POINTS + np.arange(POINTS)
        points = table["points"]
        end = np.repeat(np.array([packet.end for packet in packets]), POINTS)
        return samples_of(
            np.radians(degrees).ravel(),
            points["mm"].ravel() * MM,
            points["intensity"].ravel().astype(float),
            end,
        )

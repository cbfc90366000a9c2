"""The packets of laser scanners, from measurements to bytes; angles clockwise in degrees, distances in mm."""

from __future__ import annotations

import math
import struct
from functools import reduce
from operator import xor
from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.floating[Any]]

_LD06_HEAD = struct.Struct("<BBHH")
_LD06_TAIL = struct.Struct("<HH")


def ld06(degrees: Floats, mm: Floats, *, speed_deg_s: float, time_ms: int, intensity: int = 200) -> bytes:
    """One packet of an LD06: 12 measurements."""
    head = _LD06_HEAD.pack(0x54, 0x2C, round(speed_deg_s), _hundredths(degrees[0]))
    points = b"".join(struct.pack("<HB", int(value), intensity) for value in mm)
    body = head + points + _LD06_TAIL.pack(_hundredths(degrees[-1]), time_ms % 30000)
    return body + bytes((crc8(body),))


def _hundredths(degrees: float) -> int:
    return round(degrees * 100) % 36000


def crc8(data: bytes) -> int:
    """CRC with the polynomial x^8 + x^6 + x^3 + x^2 + 1, the highest bit first."""
    remainder = 0
    for byte in data:
        remainder ^= byte
        for _ in range(8):
            remainder <<= 1
            if remainder & 0x100:
                remainder ^= 0x14D
    return remainder


def lds01(sector: int, mm: Floats, *, rpm: float, intensity: int = 1000) -> bytes:
    """One packet of an LDS-01: the six degrees of a sector from 0 to 59."""
    body = struct.pack("<BBH", 0xFA, 0xA0 + sector, round(rpm * 10))
    body += b"".join(struct.pack("<HHH", intensity, int(value), 0) for value in mm)
    checksum = 255 - sum(body) % 256
    return body + bytes((checksum, checksum))


def ydlidar(
    first_deg: float, last_deg: float, mm: Floats, *, zero: bool = False, hertz: float = 0.0
) -> bytes:
    """One packet of an X2 or X4; ``zero`` marks the beginning of a turn."""
    kind = 1 | round(hertz * 10) << 1 if zero else 0
    first, last = (round(angle % 360 * 64) % 23040 << 1 | 1 for angle in (first_deg, last_deg))
    words = [0x55AA, kind & 0xFF | len(mm) << 8, first, last]
    samples = [round(value * 4) for value in mm]
    checksum = reduce(xor, (*words, *samples))
    return struct.pack(f"<5H{len(samples)}H", *words, checksum, *samples)


def ydlidar_correction_deg(mm: float) -> float:
    """What the host adds to an angle of an X2 or X4."""
    if mm <= 0:
        return 0.0
    return math.degrees(math.atan(21.8 * (155.3 - mm) / (155.3 * mm)))


def rplidar_nodes(degrees: Floats, mm: Floats, *, first: bool, quality: int = 47) -> bytes:
    """Nodes of a standard scan; the first one begins a turn where ``first`` says so."""
    nodes = b""
    for number, (angle, distance) in enumerate(zip(degrees, mm, strict=True)):
        begins = first and number == 0
        units = round(angle % 360 * 64) % 23040
        nodes += struct.pack(
            "<BHH", quality << 2 | (1 if begins else 2), units << 1 | 1, round(distance * 4) & 0xFFFF
        )
    return nodes


def rplidar_legacy_capsule(start_deg: float, mm: Floats, offsets: list[int], *, first: bool) -> bytes:
    """A capsule of the A1's express scan: 32 distances, ``offsets`` in eighths of a degree."""
    cabins = b""
    for even in range(0, 32, 2):
        one, two = (int(mm[even + side]) << 2 | offsets[even + side] >> 4 & 3 for side in (0, 1))
        cabins += struct.pack("<HHB", one, two, offsets[even] & 15 | (offsets[even + 1] & 15) << 4)
    return _capsule(start_deg, cabins, first)


def rplidar_dense_capsule(start_deg: float, mm: Floats, *, first: bool) -> bytes:
    """A capsule of the C1's express scan: 40 distances."""
    return _capsule(start_deg, struct.pack("<40H", *(int(value) for value in mm)), first)


def _capsule(start_deg: float, cabins: bytes, first: bool) -> bytes:
    body = struct.pack("<H", round(start_deg % 360 * 64) % 23040 | (0x8000 if first else 0)) + cabins
    checksum = reduce(xor, body)
    return bytes((0xA0 | checksum & 15, 0x50 | checksum >> 4)) + body


def rplidar_descriptor(length: int, kind: int, *, many: bool = False) -> bytes:
    """What an RPLIDAR or YDLIDAR sends before an answer."""
    return b"\xa5\x5a" + struct.pack("<IB", length | (1 << 30 if many else 0), kind)

"""Streams of a turning scanner: its packets in order, each with the time of its last measurement."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator

import numpy as np

from joshua_emulator.lidar import packets
from joshua_emulator.lidar.models import ScannerModel
from joshua_emulator.lidar.packets import Floats
from joshua_emulator.lidar.room import distances_m

_REFINEMENTS = 4  # of the direction of a beam that does not start at the axis


class Stream(ABC):
    """The measurements of one scanner as packets.

    Args:
        model: the scanner; turn_hz: its speed, which a fault changes while it runs.
        start_s: when the first measurement is taken; degrees: the scanner's direction then, clockwise.
    """

    points = 0  # measurements of one packet

    def __init__(self, model: ScannerModel, sample_hz: float, start_s: float, degrees: float = 0.0) -> None:
        self.model = model
        self.turn_hz = model.turn_hz
        self.sample_hz = sample_hz
        self.now_s = start_s
        self.degrees = degrees

    def until(self, now_s: float) -> Iterator[tuple[float, bytes]]:
        """Packets whose last measurement lies before a time."""
        while (end_s := self.now_s + self.points / self.sample_hz) <= now_s:
            step = 360 * self.turn_hz / self.sample_hz
            directions = self.degrees + step * np.arange(self.points)
            data = self.packet(directions)
            self.degrees = (self.degrees + step * self.points) % 360
            self.now_s = end_s
            yield end_s, data

    @abstractmethod
    def packet(self, degrees: Floats) -> bytes:
        """One packet of measurements in these directions, clockwise, not reduced to a turn."""


def seen_mm(degrees: Floats) -> Floats:
    """What stands in directions that are clockwise."""
    return np.round(distances_m(-np.radians(degrees)) * 1000)


def turn_begins(degrees: Floats) -> int | None:
    """Index of the measurement that begins a turn, also where the one before was in the last packet."""
    before = degrees[0] - (degrees[1] - degrees[0])
    begins = np.flatnonzero(np.diff(np.floor(degrees / 360), prepend=np.floor(before / 360)) > 0)
    return int(begins[0]) if len(begins) else None


class Ld06Stream(Stream):
    """The LD06 sends as long as it has power."""

    points = 12

    def packet(self, degrees: Floats) -> bytes:
        """Twelve measurements."""
        return packets.ld06(
            degrees, seen_mm(degrees), speed_deg_s=360 * self.turn_hz, time_ms=int(self.now_s * 1000)
        )


class Lds01Stream(Stream):
    """The LDS-01 sends a packet for each six degrees, so nothing while it stands still."""

    points = 6

    def packet(self, degrees: Floats) -> bytes:
        """The six measurements of a sector; nothing while it stands still."""
        if not self.turn_hz:
            return b""
        sector = math.floor(degrees[0] % 360 / 6 + 1e-6) % 60
        return packets.lds01(sector, seen_mm(sector * 6 + np.arange(6.0)), rpm=60 * self.turn_hz)


class YdlidarStream(Stream):
    """The X2 and the X4: 40 measurements a packet, and one of its own at the beginning of each turn."""

    points = 40

    def packet(self, degrees: Floats) -> bytes:
        """Measurements, and where a turn begins its first one."""
        mm = seen_mm(degrees)
        for _ in range(_REFINEMENTS):
            aside = np.array([packets.ydlidar_correction_deg(value) for value in mm])
            mm = seen_mm(degrees + aside)
        data = packets.ydlidar(degrees[0], degrees[-1], mm)
        begins = turn_begins(degrees)
        if begins == 0:  # right here
            return packets.ydlidar(degrees[0], degrees[0], mm[:1], zero=True, hertz=self.turn_hz) + data
        if begins is not None:  # somewhere in here
            data += packets.ydlidar(degrees[-1], degrees[-1], mm[-1:], zero=True, hertz=self.turn_hz)
        return data


class StandardStream(Stream):
    """An RPLIDAR's standard scan, ten nodes at a time."""

    points = 10

    def packet(self, degrees: Floats) -> bytes:
        """Ten nodes."""
        turned = degrees % 360
        begins = turn_begins(degrees)
        cut = begins or 0
        mm = seen_mm(degrees)
        ahead = packets.rplidar_nodes(turned[:cut], mm[:cut], first=False)
        return ahead + packets.rplidar_nodes(turned[cut:], mm[cut:], first=begins is not None)


class LegacyExpressStream(Stream):
    """The A1's express scan: the angle of each measurement is corrected for the laser's place."""

    points = 32
    _first = True

    def packet(self, degrees: Floats) -> bytes:
        """One capsule."""
        mm = seen_mm(degrees)
        offsets = np.zeros(len(mm), int)
        for _ in range(_REFINEMENTS):
            aside = np.array([-packets.ydlidar_correction_deg(value) for value in mm])
            offsets = np.clip(np.round(aside * 8 / 4), 0, 31).astype(int)
            mm = seen_mm(degrees - offsets / 8)
        first, self._first = self._first, False
        return packets.rplidar_legacy_capsule(degrees[0], mm, offsets.tolist(), first=first)


class DenseExpressStream(Stream):
    """The C1's express scan."""

    points = 40
    _first = True

    def packet(self, degrees: Floats) -> bytes:
        """One capsule."""
        first, self._first = self._first, False
        return packets.rplidar_dense_capsule(degrees[0], seen_mm(degrees), first=first)

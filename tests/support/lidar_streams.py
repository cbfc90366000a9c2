"""Streams of laser scanners with the truth about them, made by the emulator's encoders."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from joshua_emulator.lidar.models import MODELS
from joshua_emulator.lidar.streams import (
    DenseExpressStream,
    Ld06Stream,
    Lds01Stream,
    LegacyExpressStream,
    StandardStream,
    Stream,
    YdlidarStream,
)
from joshua_lidar.parsers.ld06 import Ld06Parser
from joshua_lidar.parsers.lds01 import Lds01Parser
from joshua_lidar.parsers.rplidar_express import DenseExpressParser, LegacyExpressParser
from joshua_lidar.parsers.rplidar_standard import StandardParser
from joshua_lidar.parsers.ydlidar import YdlidarParser
from joshua_lidar.samples import Parser, Samples, joined


@dataclass(frozen=True)
class Protocol:
    """One protocol: its parser, what sends it, and the bytes a second that its line carries.

    Attributes:
        lag: packets at the end that wait for what follows them.
    """

    parser: Callable[[], Parser]
    stream: type[Stream]
    model: str
    checksum: bool = True
    lag: int = 0

    @property
    def line_bytes_s(self) -> float:
        return MODELS[self.model].baudrate / 10

    def pieces(self, count: int) -> list[bytes]:
        """Packets of a scanner in the emulator's room."""
        model = MODELS[self.model]
        express = self.stream in (LegacyExpressStream, DenseExpressStream)
        stream = self.stream(model, model.express_hz if express else model.sample_hz, 0.0, 57.0)
        return [packet for _, packet in stream.until((count + 0.5) * stream.points / stream.sample_hz)]


PROTOCOLS = {
    "ld06": Protocol(Ld06Parser, Ld06Stream, "ld06"),
    "lds01": Protocol(Lds01Parser, Lds01Stream, "lds01"),
    "ydlidar": Protocol(YdlidarParser, YdlidarStream, "ydlidar_x4"),
    "rplidar_legacy": Protocol(LegacyExpressParser, LegacyExpressStream, "rplidar_a1", lag=1),
    "rplidar_dense": Protocol(DenseExpressParser, DenseExpressStream, "rplidar_c1", lag=1),
    "rplidar_standard": Protocol(StandardParser, StandardStream, "rplidar_a1", checksum=False),
}


def parse(parser: Parser, data: bytes, size: int = 0) -> Samples:
    """Feeds bytes in pieces of a size; 0: at once."""
    step = size or max(1, len(data))
    return joined([parser.feed(data[place : place + step]) for place in range(0, len(data), step)])


def keys(samples: Samples) -> list[tuple[float, float]]:
    """Measurements as values that can be compared."""
    angle = np.round(np.mod(samples.angle_rad, 2 * np.pi), 6)
    return list(zip(angle.tolist(), np.nan_to_num(samples.range_m, nan=-1.0).round(6).tolist(), strict=True))

"""A virtual laser scanner in the middle of a rectangular room."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from joshua.devices.sensor import Reading
from joshua.messages import message_class
from joshua.messages.make import header
from joshua.mock.pacing import FreeRunningSensor, Tick
from joshua.mock.settings import MockLidarSettings

LASER_SCAN = "sensor_msgs/msg/LaserScan"


class MockLidar(FreeRunningSensor):
    """A virtual laser scanner.

    ``Reading.data`` holds the ranges in metres, shape (num_beams,), float32, by REP 117: -inf is nearer than
    the scanner measures, +inf is farther, NaN would be a failed measurement.

    Args:
        settings: scan, ranges, room and rate.
        context: of the node that drives it.
    """

    settings: MockLidarSettings

    @property
    def data_types(self) -> tuple[str, ...]:
        """Laser scans."""
        return (LASER_SCAN,)

    def start(self) -> float:
        """Starts to scan."""
        return self.settings.scan_rate_hz

    def acquire(self, tick: Tick) -> npt.NDArray[np.float32]:
        """One scan of the room."""
        del tick  # nothing moves
        return cast_rays(self.settings)

    def message(self, reading: Reading, type_name: str, frame_id: str) -> Any:
        """Makes a LaserScan; beams of one scan count as simultaneous."""
        settings = self.settings
        return message_class(type_name)(
            header=header(frame_id, reading.stamp_ns),
            angle_min=settings.angle_min_rad,
            angle_max=settings.angle_max_rad,
            angle_increment=(settings.angle_max_rad - settings.angle_min_rad) / (settings.num_beams - 1),
            time_increment=0.0,
            scan_time=1.0 / settings.scan_rate_hz,
            range_min=settings.range_min_m,
            range_max=settings.range_max_m,
            ranges=reading.data,
            intensities=np.zeros(0, np.float32),
        )

    def implausible(self, reading: Reading) -> str:
        """Says when a range is neither a measurement nor a value of REP 117."""
        ranges = reading.data
        low, high = np.float32(self.settings.range_min_m), np.float32(self.settings.range_max_m)
        measured = ranges[np.isfinite(ranges)]
        outside = measured[(measured < low) | (measured > high)]
        return f"{len(outside)} ranges lie outside {low} m to {high} m" if len(outside) else ""


def cast_rays(settings: MockLidarSettings) -> npt.NDArray[np.float32]:
    """Distances from the middle of the room to its walls, shape (num_beams,), in metres, by REP 117."""
    angles = np.linspace(settings.angle_min_rad, settings.angle_max_rad, settings.num_beams)
    with np.errstate(divide="ignore"):
        to_end = settings.room_length_m / 2 / np.abs(np.cos(angles))
        to_side = settings.room_width_m / 2 / np.abs(np.sin(angles))
    ranges = np.minimum(to_end, to_side)
    ranges[ranges < settings.range_min_m] = -np.inf
    ranges[ranges > settings.range_max_m] = np.inf
    return ranges.astype(np.float32)

"""A virtual rotary encoder that turns at a constant speed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from joshua.devices.sensor import Reading
from joshua.devices.units import ticks_to_rad
from joshua.messages.make import joint_state
from joshua.mock.pacing import NS_PER_S, FreeRunningSensor, Tick
from joshua.mock.settings import MockEncoderSettings

JOINT_STATE = "sensor_msgs/msg/JointState"


@dataclass(frozen=True)
class EncoderReading:
    """State of a rotary encoder since it was opened.

    Attributes:
        ticks: whole counts, over several turns.
        position_rad: the same in radians.
        velocity_rad_s: speed of the shaft.
    """

    ticks: int
    position_rad: float
    velocity_rad_s: float


class MockEncoder(FreeRunningSensor):
    """A virtual rotary encoder; ``Reading.data`` is an ``EncoderReading``.

    Args:
        settings: resolution, speed and rate.
        context: of the node that drives it.
    """

    settings: MockEncoderSettings

    @property
    def data_types(self) -> tuple[str, ...]:
        """The state of one joint."""
        return (JOINT_STATE,)

    def start(self) -> float:
        """Starts to count from 0."""
        self._first_ns: int | None = None
        return self.settings.sample_rate_hz

    def acquire(self, tick: Tick) -> EncoderReading:
        """The state of the shaft."""
        if self._first_ns is None:
            self._first_ns = tick.stamp_ns
        settings = self.settings
        speed = -settings.speed_rad_s if settings.inverted else settings.speed_rad_s
        turned_rad = speed * (tick.stamp_ns - self._first_ns) / NS_PER_S
        ticks = math.floor(turned_rad * settings.resolution / math.tau)
        position = ticks_to_rad(ticks, ticks_per_turn=settings.resolution, zero_ticks=0)
        return EncoderReading(ticks, position, speed)

    def message(self, reading: Reading, type_name: str, frame_id: str) -> Any:
        """Makes a JointState of one joint."""
        del type_name  # there is only one
        data: EncoderReading = reading.data
        return joint_state(
            ["joint_1"], [data.position_rad], [data.velocity_rad_s], frame_id=frame_id, at_ns=reading.stamp_ns
        )

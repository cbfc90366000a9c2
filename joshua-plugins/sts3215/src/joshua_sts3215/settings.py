"""Settings of the driver, made from an ``sts3215_config`` block and the plan's calibration."""

from __future__ import annotations

from typing import Annotated, ClassVar

from joshua.api import FromField
from joshua_servo.settings import ServoSettings

from joshua_sts3215.registers import BAUDRATES, MAX_SPEED_TICKS_S, MODEL_NAMES, MODEL_NUMBER


class Sts3215Settings(ServoSettings):
    """What the driver is set to. Ticks stay ticks here: the servo counts in them.

    Attributes:
        velocity_ticks_s, acceleration: of a move; 0 leaves the servo's own maximum.
    """

    servo_name: ClassVar[str] = "STS3215"
    line_speeds: ClassVar[tuple[int, ...]] = tuple(BAUDRATES.values())
    factory_speed: ClassVar[int] = 1_000_000

    velocity_ticks_s: Annotated[int, FromField("velocity")] = 0
    acceleration: int = 0

    @property
    def models(self) -> dict[int, str]:
        """Expected model of each servo by its id."""
        return dict.fromkeys(self.motor_ids, MODEL_NAMES[MODEL_NUMBER])

    def speeds_ticks_s(self) -> list[float]:
        """Fastest move of each motor."""
        speed = min(self.velocity_ticks_s or MAX_SPEED_TICKS_S, MAX_SPEED_TICKS_S)
        return [float(speed)] * len(self.motor_ids)

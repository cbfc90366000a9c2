"""Settings of the driver, made from an ``sts3215_config`` block and the plan's calibration."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar

from joshua.api import FromField
from joshua_servo.register import Register
from joshua_servo.settings import GRIP_DEFAULTS, ServoJoint, ServoSettings

from joshua_sts3215.registers import (
    LINE_SPEEDS,
    MAX_SPEED_TICKS_S,
    MODEL_NAMES,
    MODEL_NUMBER,
    OVERLOAD_TIME,
    OVERLOAD_TORQUE,
    POSITION_D,
    POSITION_I,
    POSITION_P,
    PROTECTION_CURRENT,
    TORQUE_LIMIT,
)


class Sts3215Joint(ServoJoint):
    """Settings of one servo, in the units of the block."""

    #: Values commonly used for the grippers of SO-100 and SO-101 arms.
    gripper_defaults: ClassVar[Mapping[str, float]] = {
        **GRIP_DEFAULTS,
        "torque_limit_percent": 50,
        "protection_current_ma": 1625,
        "overload_torque_percent": 25,
        "position_p": 16,
    }

    protection_current_ma: float | None = None
    overload_torque_percent: float | None = None
    overload_time_s: float | None = None

    @property
    def overload(self) -> tuple[float, float]:
        """Load in % and time in s that trip the overload protection; factory values if the file sets none."""
        return self.overload_torque_percent or 80, self.overload_time_s or 2


class Sts3215Settings(ServoSettings):
    """Settings of the driver. Positions stay in ticks, the unit of the servo.

    Attributes:
        velocity_ticks_s, acceleration: of a move; 0 keeps the servo's own maximum.
    """

    servo_name: ClassVar[str] = "STS3215"
    line_speeds: ClassVar[tuple[int, ...]] = LINE_SPEEDS
    factory_speed: ClassVar[int] = 1_000_000

    joint_type: ClassVar[type[ServoJoint]] = Sts3215Joint
    tuned: ClassVar[Mapping[str, tuple[Register, float]]] = {
        "position_p": (POSITION_P, 1),
        "position_d": (POSITION_D, 1),
        "position_i": (POSITION_I, 1),
        "protection_current_ma": (PROTECTION_CURRENT, 1 / 6.5),
        "overload_time_s": (OVERLOAD_TIME, 100),
        "overload_torque_percent": (OVERLOAD_TORQUE, 1),
        "torque_limit_percent": (TORQUE_LIMIT, 10),
    }

    joint: tuple[Sts3215Joint, ...] = ()
    velocity_ticks_s: Annotated[int, FromField("velocity")] = 0
    acceleration: int = 0

    @property
    def models(self) -> dict[int, str]:
        """Expected model of each servo, by id."""
        return dict.fromkeys(self.motor_ids, MODEL_NAMES[MODEL_NUMBER])

    def speeds_ticks_s(self) -> list[float]:
        """Velocity limit of each motor's moves."""
        speed = min(self.velocity_ticks_s or MAX_SPEED_TICKS_S, MAX_SPEED_TICKS_S)
        return [float(speed)] * len(self.motor_ids)

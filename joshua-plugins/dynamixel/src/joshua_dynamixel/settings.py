"""Settings of the driver, made from a ``dynamixel_config`` block and the plan's calibration."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from joshua.api import FieldError
from joshua_servo.register import Register
from joshua_servo.settings import GRIP_DEFAULTS, ServoJoint, ServoSettings
from pydantic import Field, model_validator
from typing_extensions import Self

from joshua_dynamixel.models import MODELS, Model
from joshua_dynamixel.registers import (
    BAUDRATES,
    GOAL_CURRENT,
    GOAL_PWM,
    POSITION_D,
    POSITION_I,
    POSITION_P,
    VELOCITY_TICKS_S,
)


class DynamixelJoint(ServoJoint):
    """Settings of one servo, in the units of the block."""

    gripper_defaults: ClassVar[Mapping[str, float]] = {**GRIP_DEFAULTS, "torque_limit_percent": 50}

    current_limit_ma: float | None = None

    @property
    def overload(self) -> tuple[float, float]:
        """Load in % that trips the servo, and the time in s: conservative, because none is published."""
        return 80, 1


class DynamixelSettings(ServoSettings):
    """Settings of the driver. Positions stay in ticks, the unit of the servo.

    Attributes:
        models: names of the models, one for each id or one for all.
        velocity: of a move, in units of 0.229 rev/min; 0 keeps the servo's own maximum.
        acceleration: of a move, in units of 214.577 rev/min²; 0 keeps the servo's own maximum.
    """

    servo_name: ClassVar[str] = "Dynamixel X-series"
    line_speeds: ClassVar[tuple[int, ...]] = tuple(BAUDRATES.values())
    factory_speed: ClassVar[int] = 57_600

    joint_type: ClassVar[type[ServoJoint]] = DynamixelJoint
    tuned: ClassVar[Mapping[str, tuple[Register, float]]] = {
        "position_d": (POSITION_D, 1),
        "position_i": (POSITION_I, 1),
        "position_p": (POSITION_P, 1),
        "torque_limit_percent": (GOAL_PWM, 8.85),
        "current_limit_ma": (GOAL_CURRENT, 0),  # the unit depends on the model
    }

    joint: tuple[DynamixelJoint, ...] = ()
    models: tuple[str, ...] = Field(min_length=1)
    velocity: int = 0
    acceleration: int = 0

    @model_validator(mode="after")
    def _has_a_model_for_each_id(self) -> Self:
        if len(self.models) not in (1, len(self.motor_ids)):
            raise FieldError(
                "models",
                f"models has {len(self.models)} entries, but motor_ids has {len(self.motor_ids)}",
                allowed=("1 model for all servos", f"{len(self.motor_ids)} models, one for each id"),
                remedy="write one model for each id, in the same order, or one for all",
            )
        return self

    @model_validator(mode="after")
    def _measures_the_current_that_it_limits(self) -> Self:
        if len(self.models) not in (1, len(self.motor_ids)):
            return self
        for joint, model in zip(self.joint_settings, self.joint_models, strict=True):
            assert isinstance(joint, DynamixelJoint)
            if joint.current_limit_ma is not None and not model.current_unit_a:
                raise FieldError(
                    "joint",
                    f"an {model.name} has no current limit, because it measures load instead of current",
                    remedy="set torque_limit_percent instead of current_limit_ma",
                )
        return self

    def steps(self, name: str, index: int) -> float:
        """Steps of the current register per mA."""
        del name
        return 0.001 / self.joint_models[index].current_unit_a

    @property
    def joint_models(self) -> tuple[Model, ...]:
        """Models of the servos, in the order of motor_ids."""
        names = self.models * len(self.motor_ids) if len(self.models) == 1 else self.models
        return tuple(MODELS[name] for name in names)

    @property
    def models_by_id(self) -> dict[int, str]:
        """Expected model of each servo, by id."""
        return {
            servo_id: model.name for servo_id, model in zip(self.motor_ids, self.joint_models, strict=True)
        }

    def speeds_ticks_s(self) -> list[float]:
        """Velocity limit of each motor's moves."""
        return [
            min(self.velocity * VELOCITY_TICKS_S or model.max_speed_ticks_s, model.max_speed_ticks_s)
            for model in self.joint_models
        ]

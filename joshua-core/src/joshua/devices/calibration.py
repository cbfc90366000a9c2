"""Calibration of an arm as a value, which converts the ticks of its motors to radians."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, ConfigDict, Field, model_validator
from typing_extensions import Self

if TYPE_CHECKING:  # a driver gets its calibration as values
    from joshua.schema import calibration_pb2

LARGEST_OFFSET = 2047  # servos keep the offset in eleven bits and a sign


class MotorCalibration(BaseModel):
    """Calibration of one motor, in ticks of its servo.

    Attributes:
        id: on the bus.
        joint_name: of the joint that the motor moves.
        homing_offset: subtracted by the servo from its raw position, so that 2048 is zero radians.
        range_min, range_max: ends of the joint's range, homing offset applied.
        inverted: the motor turns against the joint's positive direction.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    id: int = Field(ge=0, le=253)
    joint_name: str = Field(min_length=1)
    homing_offset: int = Field(default=0, ge=-LARGEST_OFFSET, le=LARGEST_OFFSET)
    range_min: int = Field(default=0, ge=0, le=4095)
    range_max: int = Field(ge=0, le=4095)
    inverted: bool = False

    @model_validator(mode="after")
    def _has_a_range(self) -> Self:
        if self.range_min >= self.range_max:
            raise ValueError(
                f"{self.joint_name}: range_min {self.range_min} is not below range_max {self.range_max}; "
                "calibrate this joint again"
            )
        return self


class ArmCalibration(BaseModel):
    """Calibration of the motors of one arm; ids and joint names are unique.

    Attributes:
        motors: one entry for each motor.
        device_identity: of the adapter, such as ``usb:5A46082345``; "" if unknown.
        calibrated_at: RFC 3339 time; "" if unknown.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    motors: tuple[MotorCalibration, ...] = Field(min_length=1)
    device_identity: str = ""
    calibrated_at: str = ""

    @model_validator(mode="after")
    def _names_each_motor_once(self) -> Self:
        for what in ("id", "joint_name"):
            values = [getattr(motor, what) for motor in self.motors]
            twice = sorted({value for value in values if values.count(value) > 1})
            if twice:
                raise ValueError(f"{what} {twice[0]} is used twice; each motor needs a different one")
        return self

    def motor(self, motor_id: int) -> MotorCalibration | None:
        """Calibration of one motor by its bus id."""
        return next((motor for motor in self.motors if motor.id == motor_id), None)

    def to_block(self, node_name: str) -> calibration_pb2.ArmCalibration:
        """The entry of a ``calibration`` block for the node that drives the arm."""
        from joshua.schema import calibration_pb2

        return calibration_pb2.ArmCalibration(
            node_name=node_name,
            device_identity=self.device_identity,
            calibrated_at=self.calibrated_at,
            motors=[calibration_pb2.MotorCalibration(**motor.model_dump()) for motor in self.motors],
        )

    @classmethod
    def from_block(cls, block: calibration_pb2.ArmCalibration) -> Self:
        """Reads an entry of a ``calibration`` block. Raises pydantic.ValidationError."""
        return cls.model_validate(cls.values_of(block))

    @staticmethod
    def values_of(block: calibration_pb2.ArmCalibration) -> dict[str, Any]:
        """The values of an entry of a ``calibration`` block, unchecked."""
        return {
            "device_identity": block.device_identity,
            "calibrated_at": block.calibrated_at,
            "motors": [
                {name: getattr(motor, name) for name in MotorCalibration.model_fields}
                for motor in block.motors
            ],
        }

"""The settings of the gripper: the fields of its block, and the rule that spans two of them."""

import math

from joshua.api import ActuatorSettings, FieldError, JointRange
from pydantic import model_validator


class GripperSettings(ActuatorSettings):
    """Settings of the gripper; ranges and defaults stand in the proto file."""

    stroke_m: float
    finger_length_m: float
    speed_rad_s: float

    @model_validator(mode="after")
    def _check_reach(self) -> "GripperSettings":
        if self.stroke_m > 2 * self.finger_length_m:
            allowed = (f"at most {2 * self.finger_length_m:g}",)
            raise FieldError("stroke_m", "the fingers are too short to open that wide", allowed=allowed)
        return self

    def joints(self) -> tuple[JointRange, ...]:
        """The joint and its limits: from closed to the angle at which the tips are one stroke apart."""
        opening_rad = math.asin(self.stroke_m / 2 / self.finger_length_m)
        return (JointRange("gripper", 0.0, opening_rad),)

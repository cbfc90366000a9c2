"""Calibration of an arm as a value, and the LeRobot file format that holds the same facts."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from typing_extensions import Self

LARGEST_OFFSET = 2047  # the register has eleven bits and a sign


class CalibrationError(ValueError):
    """A calibration that cannot be used; the message says where and what to do."""


class MotorCalibration(BaseModel):
    """Calibration of one motor, in ticks as the servo counts them.

    Attributes:
        homing_offset: what the servo subtracts from its raw position, so that 2048 is zero radians.
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
        device_identity: of the adapter, such as ``usb:5A46082345``; "" where unknown.
        calibrated_at: RFC 3339 time.
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
                raise ValueError(f"{what} {twice[0]} stands there twice; each motor needs one of its own")
        return self

    def motor(self, servo_id: int) -> MotorCalibration | None:
        """Calibration of one motor by its bus id."""
        return next((motor for motor in self.motors if motor.id == servo_id), None)


def from_lerobot(text: str, *, source: str = "the file") -> ArmCalibration:
    """Reads a LeRobot calibration: a JSON object from joint name to the facts of its motor.

    LeRobot keeps these files below ``~/.cache/huggingface/lerobot/calibration``, one for each arm. Its
    ``homing_offset`` is the one in the servo, as here; its ``drive_mode`` 1 is ``inverted``.

    Args:
        text: content of the file.
        source: name of the file for messages.

    Raises:
        CalibrationError: the text is no such calibration.
    """
    try:
        content = json.loads(text)
    except ValueError as error:
        raise CalibrationError(f"{source}: is no JSON ({error}); export the calibration anew") from error
    if isinstance(content, dict) and "motor_names" in content:
        raise CalibrationError(
            f"{source}: is of the old LeRobot format, before version 0.2, whose offsets differ; "
            "calibrate the arm anew, with joshua or with a newer LeRobot"
        )
    if not isinstance(content, dict) or not content or not all(isinstance(v, dict) for v in content.values()):
        raise CalibrationError(
            f"{source}: a LeRobot calibration is an object from joint name to id, drive_mode, homing_offset, "
            "range_min and range_max; name a file below ~/.cache/huggingface/lerobot/calibration"
        )
    return _validated({"motors": [_motor(n, v, source) for n, v in content.items()]}, source)


def to_lerobot(calibration: ArmCalibration) -> str:
    """Writes a calibration as LeRobot reads it, joints in order of their motors."""
    content = {
        motor.joint_name: {
            "id": motor.id,
            "drive_mode": int(motor.inverted),
            "homing_offset": motor.homing_offset,
            "range_min": motor.range_min,
            "range_max": motor.range_max,
        }
        for motor in calibration.motors
    }
    return json.dumps(content, indent=4)


def _motor(joint_name: str, values: Mapping[str, Any], source: str) -> dict[str, Any]:
    fields = {"id", "drive_mode", "homing_offset", "range_min", "range_max"}
    if set(values) != fields:
        missing = ", ".join(sorted(fields - set(values))) or "none"
        unknown = ", ".join(sorted(set(values) - fields)) or "none"
        raise CalibrationError(
            f"{source}: {joint_name}: missing fields: {missing}; unknown fields: {unknown}"
        )
    if values["drive_mode"] not in (0, 1):
        raise CalibrationError(
            f"{source}: {joint_name}: drive_mode is {values['drive_mode']!r}; allowed: 0, 1"
        )
    return {
        "id": values["id"],
        "joint_name": joint_name,
        "homing_offset": values["homing_offset"],
        "range_min": values["range_min"],
        "range_max": values["range_max"],
        "inverted": bool(values["drive_mode"]),
    }


def _validated(values: dict[str, Any], source: str) -> ArmCalibration:
    try:
        return ArmCalibration.model_validate(values)
    except ValidationError as error:
        detail = error.errors(include_url=False)[0]
        place = ".".join(_place(detail["loc"], values))
        found = f" (found {detail['input']!r})" if not isinstance(detail["input"], (dict, list)) else ""
        message = detail["msg"].removeprefix("Value error, ")
        raise CalibrationError(f"{source}: {place}{': ' if place else ''}{message}{found}") from error


def _place(location: tuple[int | str, ...], values: Mapping[str, Any]) -> list[str]:
    """Names a place by joint where it can: ``('motors', 0, 'id')`` becomes ``shoulder_pan.id``."""
    if len(location) >= 2 and location[0] == "motors" and isinstance(location[1], int):
        motor = values["motors"][location[1]]
        name = motor.get("joint_name") if isinstance(motor, Mapping) else None
        return [str(name or f"motors[{location[1]}]"), *(str(part) for part in location[2:])]
    return [str(part) for part in location]

"""LeRobot's calibration files, the JSON equivalent of a ``calibration`` block."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from joshua.api.calibration import ArmCalibration
from joshua.tools import parse_json
from pydantic import ValidationError


class CalibrationError(ValueError):
    """An invalid calibration. The message gives place and remedy."""


def from_lerobot(text: str, *, source: str = "the file", servo_adds_offset: bool = False) -> ArmCalibration:
    """Parse a LeRobot calibration: a JSON object from joint name to the values of its motor.

    LeRobot keeps these files below ``~/.cache/huggingface/lerobot/calibration``, one for each arm. Its
    ``homing_offset`` is the one in the servo, as here; its ``drive_mode`` 1 is ``inverted``. Dynamixel servos
    differ in both: they add the offset, which is subtracted here, and with drive mode 1 they invert their
        positions
    themselves, so nothing is left to invert.

    Args:
        text: content of the file.
        source: name of the file for messages.
        servo_adds_offset: the arm has Dynamixel servos.

    Raises:
        CalibrationError: the text is not such a calibration.
    """
    try:
        content = parse_json(text)
    except ValueError as error:
        raise CalibrationError(
            f"{source}: is not valid JSON ({error}); export the calibration again"
        ) from error
    if isinstance(content, dict) and "motor_names" in content:
        raise CalibrationError(
            f"{source}: has the format of LeRobot before version 0.2, whose offsets differ; calibrate the "
            "arm again with joshua or a newer LeRobot"
        )
    if not isinstance(content, dict) or not content or not all(isinstance(v, dict) for v in content.values()):
        raise CalibrationError(
            f"{source}: a LeRobot calibration is an object from joint name to id, drive_mode, homing_offset, "
            "range_min and range_max; name a file below ~/.cache/huggingface/lerobot/calibration"
        )
    motors = [_motor(name, values, source) for name, values in content.items()]
    if servo_adds_offset:
        motors = [_of_adding_servo(motor) for motor in motors]
    return _validated({"motors": motors}, source)


def to_lerobot(calibration: ArmCalibration, *, servo_adds_offset: bool = False) -> str:
    """Return a calibration as LeRobot reads it, joints in motor order."""
    sign = -1 if servo_adds_offset else 1
    content = {
        motor.joint_name: {
            "id": motor.id,
            "drive_mode": int(motor.inverted),
            "homing_offset": sign * motor.homing_offset,
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


def _of_adding_servo(motor: dict[str, Any]) -> dict[str, Any]:
    offset = motor["homing_offset"]
    return {**motor, "homing_offset": -offset if isinstance(offset, int) else offset, "inverted": False}


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
    """Return a place by joint name if possible: ``('motors', 0, 'id')`` becomes ``shoulder_pan.id``."""
    if len(location) >= 2 and location[0] == "motors" and isinstance(location[1], int):
        motor = values["motors"][location[1]]
        name = motor.get("joint_name") if isinstance(motor, Mapping) else None
        return [str(name or f"motors[{location[1]}]"), *(str(part) for part in location[2:])]
    return [str(part) for part in location]

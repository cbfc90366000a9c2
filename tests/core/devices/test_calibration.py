from typing import Any

import pytest
from google.protobuf import text_format
from joshua.devices.calibration import ArmCalibration
from joshua.schema import calibration_pb2
from pydantic import ValidationError

BLOCK = """
node_name: "follower_arm"
device_identity: "usb:SN1"
calibrated_at: "2026-01-31T12:00:00Z"
motors { id: 1 joint_name: "pan" homing_offset: -300 range_min: 700 range_max: 3300 }
motors { id: 2 joint_name: "lift" range_max: 4095 inverted: true }
"""


def motor(**values: Any) -> dict[str, Any]:
    return {"id": 1, "joint_name": "a", "homing_offset": 0, "range_min": 0, "range_max": 4095} | values


def test_a_block_survives_the_way_there_and_back() -> None:
    block = text_format.Parse(BLOCK, calibration_pb2.ArmCalibration())
    calibration = ArmCalibration.from_block(block)
    assert calibration.motors[0].homing_offset == -300
    assert calibration.motors[1].inverted
    assert calibration.to_block("follower_arm") == block
    assert ArmCalibration.model_validate_json(calibration.model_dump_json()) == calibration


def test_a_motor_is_found_by_its_id() -> None:
    calibration = ArmCalibration.model_validate({"motors": [motor(id=3)]})
    assert calibration.motor(3) == calibration.motors[0]
    assert calibration.motor(2) is None


@pytest.mark.parametrize(
    ("motors", "message"),
    [
        ([motor(), motor(id=2)], "joint_name a is used twice"),
        ([motor(), motor(joint_name="b")], "id 1 is used twice; each motor needs a different one"),
        ([motor(range_min=300, range_max=300)], "a: range_min 300 is not below range_max 300; calibrate"),
        ([motor(homing_offset=-2048)], "greater than or equal to -2047"),
        ([motor(joint_name="")], "at least 1 character"),
        ([], "at least 1 item"),
    ],
)
def test_what_cannot_be_is_refused(motors: list[dict[str, Any]], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        ArmCalibration.model_validate({"motors": motors})

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from joshua.devices.calibration import ArmCalibration, MotorCalibration
from joshua_calibration.lerobot import CalibrationError, from_lerobot, to_lerobot

# as LeRobot writes it for an SO-100 follower
LEROBOT = {
    "shoulder_pan": {"id": 1, "drive_mode": 0, "homing_offset": -1470, "range_min": 758, "range_max": 3292},
    "gripper": {"id": 6, "drive_mode": 1, "homing_offset": 1407, "range_min": 2031, "range_max": 3476},
}


def test_a_lerobot_file_is_read_and_written_back_unchanged() -> None:
    calibration = from_lerobot(json.dumps(LEROBOT))
    assert calibration.motors[1] == MotorCalibration(
        id=6, joint_name="gripper", homing_offset=1407, range_min=2031, range_max=3476, inverted=True
    )
    assert json.loads(to_lerobot(calibration)) == LEROBOT
    assert to_lerobot(calibration).startswith('{\n    "shoulder_pan": {\n        "id": 1,')


@given(
    st.lists(st.tuples(st.integers(0, 4094), st.integers(-2047, 2047), st.booleans()), min_size=1, max_size=8)
)
def test_every_calibration_survives_the_way_there_and_back(rows: list[tuple[int, int, bool]]) -> None:
    calibration = ArmCalibration(
        motors=tuple(
            MotorCalibration(
                id=index,
                joint_name=f"j{index}",
                homing_offset=offset,
                range_min=low,
                range_max=low + 1,
                inverted=inv,
            )
            for index, (low, offset, inv) in enumerate(rows)
        )
    )
    assert from_lerobot(to_lerobot(calibration)) == calibration


def test_dynamixel_servos_add_what_others_subtract_and_turn_round_by_themselves() -> None:
    pan = {**LEROBOT["shoulder_pan"], "homing_offset": 300, "drive_mode": 1}
    calibration = from_lerobot(json.dumps({"shoulder_pan": pan}), servo_adds_offset=True)
    (motor,) = calibration.motors
    assert (motor.homing_offset, motor.inverted) == (-300, False)
    written = json.loads(to_lerobot(calibration, servo_adds_offset=True))["shoulder_pan"]
    assert written == {**pan, "drive_mode": 0}
    with pytest.raises(CalibrationError, match=r"homing_offset: .*integer.*\(found 'one'\)"):
        from_lerobot(
            json.dumps({"shoulder_pan": {**pan, "homing_offset": "one"}}), source="a", servo_adds_offset=True
        )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", r"arm\.json: is not valid JSON .*export the calibration again"),
        ("[" * 100_000, r"arm\.json: is not valid JSON \(it is nested more than 100 levels deep\)"),
        ("[]", r"an object from joint name to id.*name a file below ~/\.cache/huggingface"),
        ("{}", "an object from joint name"),
        (
            '{"motor_names": ["a"], "homing_offset": [1]}',
            r"format of LeRobot before version 0\.2.*calibrate the arm",
        ),
        (
            '{"a": {"id": 1}}',
            r"a: missing fields: drive_mode, homing_offset, range_max, range_min; unknown fields: none",
        ),
    ],
)
def test_what_is_no_calibration_is_refused(text: str, message: str) -> None:
    with pytest.raises(CalibrationError, match=message):
        from_lerobot(text, source="arm.json")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"drive_mode": 2}, "shoulder_pan: drive_mode is 2; allowed: 0, 1"),
        (
            {"homing_offset": 2048},
            r"shoulder_pan\.homing_offset: .*less than or equal to 2047 \(found 2048\)",
        ),
        ({"range_max": 5000}, r"shoulder_pan\.range_max: .*4095 \(found 5000\)"),
        ({"range_min": 3400}, r"range_min 3400 is not below range_max 3292; calibrate this joint again"),
        ({"id": "one"}, r"shoulder_pan\.id: .*integer.*\(found 'one'\)"),
        ({"id": 6}, "id 6 is used twice; each motor needs a different one"),
    ],
)
def test_a_wrong_value_is_named_with_its_joint(change: dict[str, Any], message: str) -> None:
    content = {**LEROBOT, "shoulder_pan": {**LEROBOT["shoulder_pan"], **change}}
    with pytest.raises(CalibrationError, match=message):
        from_lerobot(json.dumps(content), source="arm.json")

from typing import Any

import pytest
from google.protobuf import text_format
from joshua.plugins import ActuatorSpec, load_registry
from joshua.plugins.block_context import BlockContext
from joshua.plugins.settings import make_settings
from joshua.schema import config_pb2
from joshua.schema.calibration_pb2 import ArmCalibration
from joshua_sts3215.settings import Sts3215Settings

BLOCK = """
comm { serial { port: "/dev/ttyACM0" baudrate: 1000000 } }
motor_ids: [1, 2]
position_min: 100
position_max: 4000
velocity: 1000
acceleration: 200
"""
CALIBRATION: dict[str, Any] = {
    "device_identity": "usb:SN1",
    "calibrated_at": "2026-01-31T12:00:00Z",
    "motors": [
        {
            "id": 1,
            "joint_name": "pan",
            "homing_offset": 5,
            "range_min": 1024,
            "range_max": 3072,
            "inverted": False,
        },
        {
            "id": 2,
            "joint_name": "lift",
            "homing_offset": 0,
            "range_min": 0,
            "range_max": 2048,
            "inverted": True,
        },
    ],
}
CALIBRATED = BlockContext(ArmCalibration(**CALIBRATION))


def settings_of(text: str, context: BlockContext | None = None) -> tuple[Any, list[Any]]:
    block = text_format.Parse(text, config_pb2.STS3215Config())
    spec = load_registry().find(ActuatorSpec, "sts3215_config", "ACTION_FOLLOWER")
    assert spec is not None
    return make_settings(spec, block, context=context, field_path="robot.actions[0].sts3215_config")


def good(text: str = BLOCK, context: BlockContext | None = None) -> Sts3215Settings:
    settings, problems = settings_of(text, context)
    assert problems == []
    assert isinstance(settings, Sts3215Settings)
    return settings


def test_a_block_becomes_settings_that_survive_json() -> None:
    settings = good()
    assert (settings.port, settings.baudrate, settings.motor_ids) == ("/dev/ttyACM0", 1_000_000, (1, 2))
    assert (settings.position_min_ticks, settings.velocity_ticks_s, settings.acceleration) == (100, 1000, 200)
    assert settings.joint_names == ("joint_1", "joint_2")
    assert Sts3215Settings.model_validate(settings.model_dump(mode="json")) == settings


def test_an_uncalibrated_arm_has_its_zero_in_the_middle_of_its_range() -> None:
    settings = good()
    assert settings.zero_ticks == 2050
    assert settings.joints()[0].min_rad == pytest.approx(-settings.joints()[0].max_rad)


def test_a_calibration_gives_names_zero_and_the_tighter_range() -> None:
    settings = good(context=CALIBRATED)
    assert settings.zero_ticks == 2048
    assert settings.ranges_ticks() == [(1024, 3072), (100, 2048)]
    pan, lift = settings.joints()
    assert (pan.name, lift.name) == ("pan", "lift")
    assert (pan.min_rad, pan.max_rad) == pytest.approx((-1.5708, 1.5708), abs=1e-4)
    assert (lift.min_rad, lift.max_rad) == pytest.approx((0.0, 2.9882), abs=1e-4)  # inverted
    assert Sts3215Settings.model_validate(settings.model_dump(mode="json")) == settings


def test_a_port_may_be_named_by_its_adapter() -> None:
    by_number = good(BLOCK.replace('port: "/dev/ttyACM0"', 'serial_number: "5A4"'))
    assert (by_number.port, by_number.serial_number) == ("", "5A4")
    assert good(BLOCK.replace('port: "/dev/ttyACM0"', 'vid_pid: "1a86:55d3"')).vid_pid == "1a86:55d3"


@pytest.mark.parametrize(
    ("old", "new", "path", "message", "allowed"),
    [
        ('port: "/dev/ttyACM0"', "", "comm", "needs a serial port", "serial { port: … }"),
        ("serial", "ble", "comm", "needs a serial port", "serial { port: … }"),
        ("1000000", "921600", "comm.serial.baudrate", "no line speed of 921600", "1000000"),
        (
            'port: "/dev/ttyACM0"',
            'vid_pid: "usb"',
            "comm.serial.vid_pid",
            "four hexadecimal digits",
            '"1a86:55d3"',
        ),
        ("position_min: 100", "position_min: 4000", "position_max", "The range is empty", "4001 to 4095"),
    ],
)
def test_rules_across_fields_point_at_the_field(
    old: str, new: str, path: str, message: str, allowed: str
) -> None:
    text = BLOCK.replace(old, new)
    if new == "ble":
        text = text.replace('port: "/dev/ttyACM0" baudrate: 1000000', 'device_name: "x"')
    settings, (problem, *_) = settings_of(text)
    assert settings is None
    assert problem.field_path == f"robot.actions[0].sts3215_config.{path}"
    assert message in problem.message
    assert problem.allowed[0] == allowed
    assert problem.remedy


def test_a_calibration_must_know_each_motor_and_leave_it_a_range() -> None:
    _, (problem,) = settings_of(BLOCK.replace("[1, 2]", "[1, 5]"), CALIBRATED)
    assert "has no motor 5" in problem.message
    assert problem.allowed == ("1", "2")
    _, (problem,) = settings_of(BLOCK.replace("min: 100", "min: 3100"), CALIBRATED)
    assert "The joint pan cannot move: position_min 3100" in problem.message
    broken = {**CALIBRATION, "motors": [{**CALIBRATION["motors"][0], "range_max": 9999}]}
    settings, (problem, *_) = settings_of(BLOCK, BlockContext(ArmCalibration(**broken)))
    assert settings is None
    assert "range_max" in problem.message

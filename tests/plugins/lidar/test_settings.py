"""Rules across the fields of a scanner's block."""

from __future__ import annotations

from typing import Any

from joshua.plugins import SensorSpec, load_registry
from joshua.plugins.settings import make_settings as settings_of
from joshua.schema import config_pb2
from lidar_settings import make_settings


def problem(
    baudrate: int = 115_200, port: str = "/dev/ttyUSB0", **fields: Any
) -> tuple[str, str, tuple[str, ...]]:
    spec = load_registry().find(SensorSpec, "lidar_config", "PERCEPTION_LIDAR")
    assert spec is not None
    values = {"angle_min": -3.1415, "angle_max": 3.1415, "range_min": 0.1, "range_max": 12.0}
    block = config_pb2.LidarConfig(**{**values, **fields})
    block.comm.serial.port = port
    block.comm.serial.baudrate = baudrate
    made, (diagnostic,) = settings_of(spec, block)
    assert made is None
    return diagnostic.field_path, diagnostic.message, diagnostic.allowed


def test_the_values_of_a_block() -> None:
    settings = make_settings("/dev/ttyUSB0", "ld19", angle_min=-1.0)
    assert settings.angle_min_rad == -1.0
    assert settings.range_max_m == 12.0
    assert settings.scan_mode == "express"
    assert settings.baudrate == 230_400
    assert not settings.display


def test_a_line_speed_that_the_model_does_not_have() -> None:
    field, message, allowed = problem(115_200, model="ld19")
    assert field == "comm.serial.baudrate"
    assert message == "The LD19 runs at 230400 bit/s only."
    assert allowed == ("230400",)


def test_a_window_of_more_than_a_turn() -> None:
    field, message, allowed = problem(angle_min=-6.0, angle_max=6.0)
    assert field == "angle_max"
    assert "is 12 rad wide, more than a turn" in message
    assert allowed == ("at most 0.2832 rad",)


def test_a_window_and_a_range_without_width() -> None:
    assert "the scan has no width" in problem(angle_min=1.0, angle_max=1.0)[1]
    assert "the scanner can measure nothing" in problem(range_min=3.0, range_max=3.0)[1]


def test_a_scan_mode_where_there_is_none() -> None:
    field, message, _ = problem(230_400, model="ld19", scan_mode="standard")
    assert field == "scan_mode"
    assert "has only one scan mode, so scan_mode has no effect" in message


def test_no_port() -> None:
    assert "A laser scanner needs a serial port" in problem(port="")[1]

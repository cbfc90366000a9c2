"""Rules across the fields of an encoder's block."""

from __future__ import annotations

from typing import Any

import pytest
from encoder_settings import make_settings
from joshua.plugins import SensorSpec, load_registry
from joshua.plugins.settings import make_settings as settings_of
from joshua.schema import config_pb2


def problem(port: str = "/dev/ttyACM0", **fields: Any) -> tuple[str, str, tuple[str, ...]]:
    spec = load_registry().find(SensorSpec, "encoder_config", "PERCEPTION_ENCODER")
    assert spec is not None
    block = config_pb2.EncoderConfig(**{"resolution": 4096, **fields})
    block.comm.serial.port = port
    block.comm.serial.baudrate = 115_200
    made, (diagnostic,) = settings_of(spec, block)
    assert made is None
    return diagnostic.field_path, diagnostic.message, diagnostic.allowed


def test_what_is_left_out() -> None:
    settings = make_settings("/dev/ttyACM0")
    assert settings.protocol == "line"
    assert settings.joint_names == ("joint_1",)
    assert settings.addresses == ()
    assert settings.rate_hz == 100.0
    settings = make_settings("/dev/ttyACM0", "amt21")
    assert settings.addresses == (0x54,)
    settings = make_settings("/dev/ttyACM0", "amt21", address=[84, 88])
    assert settings.joint_names == ("joint_1", "joint_2")


def test_encoders_are_asked_at_the_rate_of_the_fastest_publisher() -> None:
    from joshua_encoder.settings import EncoderSettings

    node = config_pb2.Node()
    node.publishers.add(publish_rate_hz=20.0)
    node.publishers.add(publish_rate_hz=50.0)
    block = config_pb2.EncoderConfig(resolution=4096)
    block.comm.serial.port = "/dev/ttyACM0"
    assert EncoderSettings.from_block(block, node).rate_hz == 50.0


@pytest.mark.parametrize(
    ("fields", "field", "message"),
    [
        ({"port": ""}, "comm", "An encoder needs a serial port"),
        ({"protocol": "as5600", "resolution": 1024}, "resolution", "An AS5600 has 4096 counts"),
        ({"protocol": "amt21", "resolution": 1000}, "resolution", "An AMT21 has 16384 (14 bits) or 4096"),
        ({"protocol": "as5600", "counter_range": 65536}, "counter_range", "would have no effect"),
        ({"counter_range": 1}, "counter_range", "A counter needs at least two counts"),
        ({"address": [84]}, "address", "has no addresses; address would have no effect"),
        ({"protocol": "amt21", "address": [85]}, "address[0]", "lowest two bits of an AMT21's address are 0"),
        ({"protocol": "amt21", "address": [84, 84]}, "address[1]", "Two encoders have the address 84"),
        ({"joint_name": ["a", "b"]}, "joint_name", "2 names are given for 1 encoders"),
        (
            {"protocol": "amt21", "address": [84, 88], "joint_name": ["a", "a"]},
            "joint_name[1]",
            "Two encoders are called a",
        ),
        ({"joint_name": [""]}, "joint_name[0]", "A joint has an empty name"),
    ],
)
def test_what_does_not_fit(fields: dict[str, Any], field: str, message: str) -> None:
    path, text, _ = problem(**fields)
    assert path == field
    assert message in text


def test_the_nearest_allowed_value_comes_first() -> None:
    assert problem(protocol="amt21", resolution=4000)[2] == ("4096", "16384")
    assert problem(protocol="amt21", address=[86])[2] == ("84", "88")

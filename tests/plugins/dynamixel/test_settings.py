from typing import Any

import pytest
from google.protobuf import text_format
from joshua.plugins import ActuatorSpec, load_registry
from joshua.plugins.block_context import BlockContext
from joshua.plugins.settings import make_settings
from joshua.schema import config_pb2
from joshua_dynamixel.settings import DynamixelSettings

BLOCK = """
comm { serial { port: "/dev/ttyACM0" baudrate: 1000000 } }
motor_ids: [1, 2]
models: "xl330-m077"
position_max: 4095
"""


def settings_of(text: str, context: BlockContext | None = None) -> tuple[Any, list[Any]]:
    block = text_format.Parse(text, config_pb2.DynamixelConfig())
    spec = load_registry().find(ActuatorSpec, "dynamixel_config", "ACTION_LEADER")
    assert spec is not None
    return make_settings(spec, block, context=context, field_path="robot.actions[0].dynamixel_config")


def test_a_block_becomes_settings_that_survive_json() -> None:
    settings, problems = settings_of(BLOCK + "velocity: 100 acceleration: 20")
    assert problems == []
    assert isinstance(settings, DynamixelSettings)
    assert (settings.port, settings.velocity, settings.acceleration) == ("/dev/ttyACM0", 100, 20)
    assert settings.models_by_id == {1: "xl330-m077", 2: "xl330-m077"}
    assert settings.speeds_ticks_s() == pytest.approx([1563.3] * 2, abs=0.1)
    assert DynamixelSettings.model_validate_json(settings.model_dump_json()) == settings


def test_one_model_for_each_id() -> None:
    settings, _ = settings_of(BLOCK.replace('"xl330-m077"', '["xl430-w250", "xl330-m288"]'))
    assert settings.models_by_id == {1: "xl430-w250", 2: "xl330-m288"}
    assert settings.speeds_ticks_s() == pytest.approx([61 / 60 * 4096, 103 / 60 * 4096])


@pytest.mark.parametrize(
    ("text", "field", "message", "allowed"),
    [
        (
            BLOCK.replace('models: "xl330-m077"', 'models: ["xl330-m077", "xl330-m077", "xl330-m077"]'),
            "models",
            "models has 3 entries, but motor_ids has 2",
            "2 models, one for each id",
        ),
        (
            BLOCK.replace("1000000", "500000"),
            "comm.serial.baudrate",
            "Dynamixel X-series servos have no line speed of 500000 bit/s",
            "115200",
        ),
    ],
)
def test_what_does_not_fit_is_explained(text: str, field: str, message: str, allowed: str) -> None:
    _, (problem, *_) = settings_of(text)
    assert problem.field_path == f"robot.actions[0].dynamixel_config.{field}"
    assert problem.message == message + "."
    assert allowed in problem.allowed
    assert problem.remedy

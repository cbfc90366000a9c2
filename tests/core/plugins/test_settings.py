from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any

import pytest
from joshua.plan import Position
from joshua.plugins import ActuatorSpec, PluginSpec
from joshua.plugins.block_context import BlockContext
from joshua.plugins.block_values import block_values, shortest_float32
from joshua.plugins.settings import BlockSettings, FieldError, FromField, make_settings
from joshua.schema import config_pb2
from joshua.textproto.positions import Positions
from joshua.textproto.source import Source, Span
from pydantic import Field, model_validator


def to_rad(ticks: int) -> float:
    return (ticks - 2048) * math.tau / 4096


class MotorSettings(BlockSettings):
    num_motors: int
    low_rad: Annotated[float, FromField("position_min", to_rad)]
    high_rad: Annotated[float, FromField("position_max", to_rad), Field(le=3.0)]
    motion: str
    time_constant_s: float
    launching: bool = False

    @classmethod
    def si_values(cls, values: Mapping[str, Any], node: Any, context: BlockContext) -> dict[str, Any]:
        return {**super().si_values(values, node, context), "launching": context.launch}

    @model_validator(mode="after")
    def _ordered(self) -> MotorSettings:
        if self.low_rad >= self.high_rad:
            raise FieldError(
                "position_max",
                "position_max must be above position_min",
                allowed=("more than position_min",),
                remedy="swap the two limits",
            )
        return self


class SerialSettings(BlockSettings):
    port: Annotated[str, FromField("comm.serial.port")]


class BrokenSettings(BlockSettings):
    @classmethod
    def si_values(cls, values: Mapping[str, Any], node: Any, context: BlockContext) -> dict[str, Any]:
        return {"stroke_m": values["no_such_field"]}


def positions(path: str, place: Position) -> Positions:
    """A file in which one field stands at one place."""
    start = place.line - 1 + place.column - 1
    text = "\n" * (place.line - 1) + " " * (place.column - 1) + "x" * place.length
    span = Span(Source(place.file, text), start, start + place.length)
    found = Positions()
    found.record(path, span, span)
    return found


def spec(name: str) -> PluginSpec:
    return ActuatorSpec(block="mock_motor_config", implementation="a:B", settings=name)


@pytest.fixture
def motors(monkeypatch: pytest.MonkeyPatch) -> PluginSpec:
    import sys
    import types

    module = types.ModuleType("acme_settings_for_test")
    module.MotorSettings = MotorSettings  # type: ignore[attr-defined]
    module.SerialSettings = SerialSettings  # type: ignore[attr-defined]
    module.NotSettings = dict  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, module.__name__, module)
    return spec("acme_settings_for_test:MotorSettings")


def test_an_omitted_optional_field_without_a_default_has_no_value() -> None:
    assert block_values(config_pb2.CameraConfig())["brightness"] is None
    assert block_values(config_pb2.CameraConfig(brightness=0))["brightness"] == 0


def test_omitted_fields_mean_what_their_rules_say() -> None:
    values = block_values(config_pb2.MockMotorConfig(num_motors=6, position_max=4095))
    assert values == {
        "num_motors": 6,
        "position_min": 0,
        "position_max": 4095,
        "motion": "MOCK_MOTION_NONE",
        "motion_amplitude_rad": 0.5,
        "motion_frequency_hz": 0.2,
        "motion_file": "",
        "time_constant_s": 0.05,
    }


def test_a_set_zero_is_not_an_omitted_field() -> None:
    assert block_values(config_pb2.MockMotorConfig(motion_amplitude_rad=0.0))["motion_amplitude_rad"] == 0.0
    assert block_values(config_pb2.QoSSettings())["depth"] == 10


def test_inner_messages_and_lists() -> None:
    block = config_pb2.STS3215Config(motor_ids=[1, 2])
    assert block_values(block)["comm"] is None
    block.comm.serial.port = "/dev/ttyACM0"
    values = block_values(block)
    assert values["motor_ids"] == [1, 2]
    assert values["comm"]["serial"]["port"] == "/dev/ttyACM0"


@pytest.mark.parametrize("value", [0.1, 0.2, 3.1416, 1e-7, 123456.79, 3.4028235e38, -0.0])
def test_floats_are_the_shortest_decimal(value: float) -> None:
    import struct

    single = struct.unpack("<f", struct.pack("<f", value))[0]
    assert shortest_float32(single) == pytest.approx(value, rel=1e-7)
    assert struct.pack("<f", shortest_float32(single)) == struct.pack("<f", value)
    assert len(repr(shortest_float32(single))) <= len(repr(single))


def test_settings_are_in_si_units_and_json_able(motors: PluginSpec) -> None:
    block = config_pb2.MockMotorConfig(
        num_motors=2, position_min=1024, position_max=3072, time_constant_s=0.1
    )
    settings, problems = make_settings(motors, block, context=BlockContext(launch=True))
    assert problems == []
    assert isinstance(settings, MotorSettings)
    assert settings.low_rad == pytest.approx(-math.pi / 2)
    assert settings.high_rad == pytest.approx(math.pi / 2)
    assert settings.time_constant_s == 0.1
    assert settings.launching
    assert MotorSettings.model_validate(settings.model_dump(mode="json")) == settings


def test_a_rule_across_fields_becomes_a_diagnostic_on_its_field(motors: PluginSpec) -> None:
    block = config_pb2.MockMotorConfig(num_motors=2, position_min=3000, position_max=1000)
    path = "robot.actions[0].mock_motor_config"
    where = Position(file="robot.pbtxt", line=7, column=19, length=4)
    settings, problems = make_settings(
        motors, block, field_path=path, positions=positions(f"{path}.position_max", where)
    )
    assert settings is None
    (problem,) = problems
    assert problem.code == "invalid-setting"
    assert problem.field_path == f"{path}.position_max"
    assert problem.position == where
    assert problem.found == "1000"
    assert problem.message == "position_max must be above position_min."
    assert problem.allowed == ("more than position_min",)
    assert problem.remedy == "Swap the two limits."


def test_a_pydantic_bound_points_at_the_field_that_the_setting_comes_from(motors: PluginSpec) -> None:
    block = config_pb2.MockMotorConfig(num_motors=2, position_max=4095)
    around = Position(file="robot.pbtxt", line=3, column=5)
    _, problems = make_settings(
        motors, block, field_path="robot.actions[0].x", positions=positions("robot.actions[0]", around)
    )
    (problem,) = problems
    assert problem.field_path == "robot.actions[0].x.position_max"
    assert problem.message == "position_max: Input should be less than or equal to 3."
    assert problem.allowed == ("at most 3.0",)
    assert problem.found == "4095"
    assert problem.position == around, "the innermost block that has a position"


def test_an_absent_inner_field_is_named_by_its_path(motors: PluginSpec) -> None:
    del motors
    block = config_pb2.STS3215Config(motor_ids=[1])
    _, problems = make_settings(spec("acme_settings_for_test:SerialSettings"), block, field_path="b")
    assert [(p.field_path, p.message) for p in problems] == [
        ("b.comm.serial.port", "comm.serial.port is missing.")
    ]


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ("no_such_module_x:Settings", "no_such_module_x:Settings cannot be imported: ModuleNotFoundError"),
        ("acme_settings_for_test:Missing", "acme_settings_for_test has no Missing"),
        ("acme_settings_for_test:NotSettings", "is not derived from joshua.plugins.settings.BlockSettings"),
    ],
)
def test_a_settings_model_that_leads_nowhere_is_a_diagnostic(
    motors: PluginSpec, settings: str, reason: str
) -> None:
    del motors
    result, problems = make_settings(spec(settings), config_pb2.MockMotorConfig(), field_path="b")
    assert result is None
    (problem,) = problems
    assert problem.code == "broken-plugin"
    assert reason in problem.message
    assert "joshua plugins --check" in problem.remedy


def test_a_spec_without_settings_needs_none() -> None:
    assert make_settings(spec(""), config_pb2.MockMotorConfig()) == (None, [])


def test_a_defect_of_the_plugins_own_code_is_a_finding() -> None:
    settings, (finding,) = make_settings(
        spec(f"{__name__}:BrokenSettings"), config_pb2.MockMotorConfig(), field_path="robot.actions[0]"
    )
    assert settings is None
    assert finding.code == "broken-plugin"
    assert "BrokenSettings cannot read the block: KeyError: 'no_such_field'" in finding.message

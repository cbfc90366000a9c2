from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import pytest
from joshua.devices.sensor import Sensor
from joshua.plugins import ActuatorSpec, SensorSpec
from joshua.plugins.block_context import BlockContext
from joshua.plugins.settings import ActuatorSettings, BlockSettings, FromField
from joshua.plugins.targets import TargetError, check_targets, load_target
from joshua_mock.sensors import MockLidar


def sensor(implementation: str, **more: Any) -> SensorSpec:
    return SensorSpec(block="lidar_config", implementation=implementation, **more)


def test_an_import_string_is_loaded_with_its_attributes() -> None:
    from pathlib import Path

    assert load_target("pathlib:Path.home") == Path.home


def test_what_is_wrong_with_an_import_string_is_said() -> None:
    with pytest.raises(TargetError, match=r"a\.b:C cannot be imported: ModuleNotFoundError"):
        load_target("a.b:C")
    with pytest.raises(TargetError, match=r"pathlib:Paht: pathlib has no Paht"):
        load_target("pathlib:Paht")


def test_base_classes_are_checked_deeply() -> None:
    assert check_targets(sensor("joshua_mock.sensors:MockLidar")) == []
    assert check_targets(sensor("pathlib:PurePosixPath")) == [
        "implementation: pathlib:PurePosixPath is a class derived from pathlib.PurePath, "
        "not a class derived from joshua.devices.sensor:Sensor"
    ]
    assert check_targets(sensor("os:getcwd", settings="nowhere:S")) == [
        "settings: nowhere:S cannot be imported: ModuleNotFoundError: No module named 'nowhere'",
        "implementation: os:getcwd is a builtin_function_or_method, "
        "not a class derived from joshua.devices.sensor:Sensor",
    ]


def test_a_behaviour_of_its_own_may_use_any_implementation() -> None:
    own = sensor("collections:OrderedDict", behaviour="joshua.devices.sensor_node:SensorNode")
    assert check_targets(own) == []
    assert check_targets(sensor("a:B", behaviour="joshua.devices.sensor_node:SensorNode")) != []


def test_the_tools_of_a_bus_are_checked_like_the_rest() -> None:
    arm = ActuatorSpec(
        block="sts3215_config",
        implementation="joshua_mock.actuator:MockActuator",
        bus_tools="joshua_sts3215.bus_tools:Sts3215BusTools",
    )
    assert check_targets(arm) == []
    assert check_targets(arm.replace(bus_tools="pathlib:PurePath")) == [
        "bus_tools: pathlib:PurePath is a class derived from builtins.object, "
        "not a class derived from joshua_servo.bus_tools:BusTools"
    ]


class Unfinished(Sensor):
    def connect(self) -> None:
        pass


class Demanding(MockLidar):
    def __init__(self, settings: Any, context: Any, port: str) -> None:
        super().__init__(settings, context)
        self.port = port


class Misspelt(BlockSettings):
    stroke_mm: float
    baud: Annotated[int, FromField("comm.serial.baud")] = 9600
    simulated: bool = False


class Jointless(ActuatorSettings):
    pass


class MadeByHand(BlockSettings):
    stroke_mm: float

    @classmethod
    def si_values(cls, values: Mapping[str, Any], node: Any, context: BlockContext) -> dict[str, Any]:
        return {"stroke_mm": 1.0}


def test_a_class_that_leaves_methods_out_is_named_with_them() -> None:
    (problem,) = check_targets(sensor(f"{__name__}:Unfinished"))
    assert problem.startswith("implementation: Unfinished does not implement ")
    assert "read" in problem


def test_a_constructor_that_the_runtime_cannot_call_is_named() -> None:
    (problem,) = check_targets(sensor(f"{__name__}:Demanding"))
    assert problem.startswith(
        "implementation: Demanding cannot be constructed as Demanding(settings, context): missing a required"
    )


def test_settings_are_held_against_their_block() -> None:
    driver = "joshua_mock.sensors:MockLidar"
    assert check_targets(sensor(driver, settings=f"{__name__}:Misspelt")) == [
        "settings: Misspelt.stroke_mm reads the field stroke_mm, which joshua.LidarConfig does not have; "
        "fields there: comm, angle_min, angle_max, range_min, range_max, display, model, scan_mode",
        "settings: Misspelt.baud reads the field comm.serial.baud, which joshua.LidarConfig does not have; "
        "fields there: port, baudrate, serial_number, vid_pid",
    ]
    assert check_targets(sensor(driver, settings=f"{__name__}:MadeByHand")) == []


def test_the_settings_of_an_actuator_name_its_joints() -> None:
    def problems(settings: str) -> list[str]:
        implementation = "joshua_mock.actuator:MockActuator"
        return check_targets(
            ActuatorSpec(block="mock_motor_config", implementation=implementation, settings=settings)
        )

    assert problems(f"{__name__}:Jointless") == ["settings: Jointless names no joints: override joints"]
    assert problems(f"{__name__}:MadeByHand") == [
        "settings: MadeByHand does not derive from joshua.api.ActuatorSettings"
    ]
    assert problems("joshua_mock.settings:MockMotorSettings") == []

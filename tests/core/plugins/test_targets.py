from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from joshua.plugins import ActuatorSpec, SensorSpec
from joshua.plugins.targets import TargetError, check_targets, load_target


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
    assert check_targets(sensor("joshua.devices.sensor:Sensor")) == []
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
    own = sensor("collections:OrderedDict", behaviour="joshua.node.behaviour:NodeBehaviour")
    assert check_targets(own) == []
    assert check_targets(sensor("a:B", behaviour="joshua.node.behaviour:NodeBehaviour")) != []


def test_the_tools_of_a_bus_are_checked_like_the_rest() -> None:
    arm = ActuatorSpec(
        block="sts3215_config",
        implementation="joshua.devices.actuator:Actuator",
        bus_tools="joshua_servo.bus_tools:BusTools",
    )
    assert check_targets(arm) == []
    assert check_targets(replace(arm, bus_tools="pathlib:PurePath")) == [
        "bus_tools: pathlib:PurePath is a class derived from builtins.object, "
        "not a class derived from joshua_servo.bus_tools:BusTools"
    ]

from __future__ import annotations

import math
import subprocess
import sys
from typing import Any

import pytest
from joshua.plugins import ActuatorSpec, PluginSpec, SensorSpec, load_registry
from joshua.plugins.block_context import BlockContext
from joshua.plugins.settings import make_settings
from joshua.schema import config_pb2
from joshua.schema.calibration_pb2 import ArmCalibration
from joshua_mock.settings import (
    MockCameraSettings,
    MockEncoderSettings,
    MockLidarSettings,
    MockMotorSettings,
)
from pydantic import ValidationError


def test_motors_are_in_radians_and_numbered_from_one() -> None:
    block = config_pb2.MockMotorConfig(num_motors=2, position_min=1024, position_max=3072)
    settings = MockMotorSettings.from_block(block)
    assert settings.motion == "none"
    assert settings.time_constant_s == 0.05
    joints = settings.joints()
    assert [joint.name for joint in joints] == ["joint_1", "joint_2"]
    assert joints[0].min_rad == pytest.approx(-math.pi / 2)
    assert joints[0].max_rad == pytest.approx(math.pi / 2)


def test_the_calibration_names_joints_and_narrows_their_range() -> None:
    block = config_pb2.MockMotorConfig(num_motors=2, position_min=1024, position_max=3072)
    motor = {"id": 2, "joint_name": "elbow", "range_min": 0, "range_max": 2048}
    settings = MockMotorSettings.from_block(block, context=BlockContext(ArmCalibration(motors=[motor])))
    names = [joint.name for joint in settings.joints()]
    assert names == ["joint_1", "elbow"]
    assert settings.joints()[1].min_rad == pytest.approx(-math.pi / 2)
    assert settings.joints()[1].max_rad == 0.0


def problems_of(
    block: Any, kind: type[PluginSpec], name: str, context: BlockContext | None = None
) -> list[Any]:
    spec = load_registry().find(kind, name)
    assert isinstance(spec, PluginSpec)
    settings, problems = make_settings(spec, block, context=context, field_path="b")
    assert (settings is None) == bool(problems)
    return [(problem.field_path, problem.found, problem.message) for problem in problems]


def test_motors_without_a_range_are_refused() -> None:
    block = config_pb2.MockMotorConfig(num_motors=1, position_min=3000, position_max=3000)
    assert problems_of(block, ActuatorSpec, "mock_motor_config") == [
        (
            "b.position_max",
            "3000",
            "position_max is not above position_min: the motors have no range.",
        )
    ]


def test_a_calibration_outside_the_range_is_refused() -> None:
    block = config_pb2.MockMotorConfig(num_motors=1, position_min=1000, position_max=2000)
    motor = {"id": 1, "joint_name": "elbow", "range_min": 3000, "range_max": 3500}
    problems = problems_of(
        block, ActuatorSpec, "mock_motor_config", BlockContext(ArmCalibration(motors=[motor]))
    )
    assert problems == [
        (
            "b.position_max",
            "2000",
            "The calibrated range of elbow lies outside position_min to position_max.",
        )
    ]


def test_a_replay_needs_a_file() -> None:
    block = config_pb2.MockMotorConfig(num_motors=1, position_max=10, motion=config_pb2.MOCK_MOTION_FILE)
    assert problems_of(block, ActuatorSpec, "mock_motor_config") == [
        ("b.motion_file", '""', "motion is MOCK_MOTION_FILE, but motion_file is empty.")
    ]


def test_a_scan_without_width_or_depth_is_refused() -> None:
    block = config_pb2.MockLidarConfig(angle_min=1, angle_max=1, range_max=5)
    assert problems_of(block, SensorSpec, "mock_lidar_config") == [
        ("b.angle_max", "1.0", "angle_max is not above angle_min: the scan has no width.")
    ]
    block = config_pb2.MockLidarConfig(angle_max=1, range_min=5, range_max=5)
    assert problems_of(block, SensorSpec, "mock_lidar_config") == [
        ("b.range_max", "5.0", "range_max is not above range_min: nothing can be measured.")
    ]


def test_a_virtual_sensor_samples_as_fast_as_its_fastest_publisher() -> None:
    node = config_pb2.Node()
    node.publishers.add(publish_rate_hz=20.0)
    node.publishers.add(publish_rate_hz=50.0)
    encoder = config_pb2.MockEncoderConfig(resolution=4096)
    assert MockEncoderSettings.from_block(encoder, node).sample_rate_hz == 50.0
    assert MockEncoderSettings.from_block(encoder).sample_rate_hz == 100.0
    lidar = config_pb2.MockLidarConfig(angle_max=1, range_max=5)
    assert MockLidarSettings.from_block(lidar, node).scan_rate_hz == 50.0
    assert MockLidarSettings.from_block(lidar).num_beams == 360


def test_settings_are_frozen() -> None:
    settings = MockCameraSettings.from_block(config_pb2.MockCameraConfig(width=64, height=48, fps=30))
    with pytest.raises(ValidationError, match="frozen"):
        settings.width = 3  # type: ignore[misc]


def test_settings_load_without_numpy() -> None:
    code = "import sys, joshua_mock.settings; sys.exit('numpy' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], timeout=60, check=True)

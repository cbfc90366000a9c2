"""Settings made from the block, and what of an address is refused."""

from __future__ import annotations

import pytest
from joshua.plan import Diagnostic
from joshua.plugins import SensorSpec, load_registry
from joshua.plugins.settings import make_settings
from joshua.schema import config_pb2, data_type_pb2
from joshua_camera.settings import CameraSettings


def diagnose(source: str) -> list[Diagnostic]:
    spec = load_registry().find(SensorSpec, "camera_config", "PERCEPTION_CAMERA")
    assert spec is not None
    block = config_pb2.CameraConfig(width=640, height=480, fps=30, source=source)
    _, found = make_settings(spec, block, field_path="robot.perceptions[0].camera_config")
    return found


def test_omitted_fields() -> None:
    settings = CameraSettings.from_block(config_pb2.CameraConfig(width=640, height=480, fps=30))
    assert settings.device_id == 0
    assert settings.pixel_format == "MJPG"
    assert settings.brightness is None
    assert settings.exposure is None
    assert settings.publishes == ()


def test_zero_is_a_setting() -> None:
    block = config_pb2.CameraConfig(width=640, height=480, fps=30, brightness=0, exposure=-6)
    settings = CameraSettings.from_block(block)
    assert settings.brightness == 0
    assert settings.exposure == -6


def test_what_the_node_publishes_is_known() -> None:
    node = config_pb2.Node()
    node.publishers.add(data_type=data_type_pb2.IMAGE)
    node.publishers.add(data_type=data_type_pb2.COMPRESSED_IMAGE)
    node.publishers.add()
    block = config_pb2.CameraConfig(width=640, height=480, fps=30)
    settings = CameraSettings.from_block(block, node)
    assert settings.publishes == ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")


@pytest.mark.parametrize(
    "source",
    ["", "/dev/video2", "usb-Cam-video-index0", "clip.mp4", "http://phone:8080/video", "rtsp://u:p@[::1]/s"],
)
def test_sources_that_can_be_read(source: str) -> None:
    assert diagnose(source) == []


def test_an_unknown_scheme_names_the_nearest() -> None:
    (found,) = diagnose("htp://phone/video")
    assert found.field_path == "robot.perceptions[0].camera_config.source"
    assert found.message == "htp:// is not a supported camera address."
    assert found.allowed[0] == "http://"
    assert found.found == '"htp://phone/video"'
    assert "Copy the stream's address" in found.remedy


@pytest.mark.parametrize("source", ["http:///video", "http://phone:70000/video", "http://phone:x/video"])
def test_an_address_without_a_host_or_port(source: str) -> None:
    (found,) = diagnose(source)
    assert found.message == "The address lacks a host or has an invalid port."
    assert found.allowed == ("http://HOST:PORT/PATH",)

"""A camera is named by device_id or by source; both ways are compared."""

from __future__ import annotations

from typing import Any

import pytest
from google.protobuf import text_format
from joshua.config.checks import Context, resources
from joshua.config.loading import LoadedConfig
from joshua.schema import config_pb2 as pb
from joshua.textproto.positions import Positions

BY_ID = "usb-046d_HD_Webcam_C615_1234-video-index0"


def findings(*cameras: str) -> list[Any]:
    text = "\n".join(
        f'perceptions {{ node {{ node_name: "camera_{index}" node_id: {index} }} '
        f"camera_config {{ width: 640 height: 480 fps: 30 {camera} }} }}"
        for index, camera in enumerate(cameras)
    )
    config = text_format.Parse(f"robot {{ {text} }}", pb.Config())
    return list(resources.check(Context(LoadedConfig("", config, Positions()))))


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("device_id: 2", "device_id: 2"),
        ("device_id: 2", 'source: "/dev/video2"'),
        ('source: "/dev/video2"', 'device_id: 5 source: "/dev//video2"'),
        (f'source: "{BY_ID}"', f'source: "/dev/v4l/by-id/{BY_ID}"'),
        ('source: "/dev/camera_top"', 'source: "/dev/camera_top"'),
    ],
)
def test_one_camera_under_two_names_is_an_error(first: str, second: str) -> None:
    (finding,) = findings(first, second)
    assert finding.code == "camera-shared"
    assert "camera_0 and" in finding.message
    assert "joshua find-cameras" in finding.remedy
    assert finding.field_path.endswith("source" if "source" in second else "device_id")


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("device_id: 2", "device_id: 4"),
        ("device_id: 2", f'device_id: 2 source: "{BY_ID}"'),
        ('source: "http://phone.local/video"', 'source: "http://phone.local/video"'),
        ('source: "clips/top.mp4"', 'source: "clips/top.mp4"'),
        ('source: "clip.mp4"', 'source: "clip.mp4"'),
    ],
)
def test_two_cameras_and_shared_streams_are_none(first: str, second: str) -> None:
    assert findings(first, second) == []

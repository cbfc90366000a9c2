"""What the text of a camera's source names."""

from __future__ import annotations

import pytest
from joshua.schema.config_pb2 import CameraConfig
from joshua.schema.options_pb2 import NAMES_ADDRESS, NAMES_DEVICE, NAMES_FILE, NAMES_FILES
from joshua.textproto.field_facts import field_facts
from joshua_camera.source_text import SourceKind, device_identity, device_path, scheme, source_kind

BY_ID = "usb-046d_HD_Webcam_C615_1234-video-index0"


@pytest.mark.parametrize(
    ("source", "kind"),
    [
        (BY_ID, SourceKind.DEVICE),
        (f"/dev/v4l/by-id/{BY_ID}", SourceKind.DEVICE),
        ("/dev/video3", SourceKind.DEVICE),
        ("/dev/../dev/video3", SourceKind.DEVICE),
        ("http://phone.local:8080/video", SourceKind.ADDRESS),
        ("RTSP://camera/stream", SourceKind.ADDRESS),
        ("clips/top.mp4", SourceKind.FILE),
        ("/srv/clips/top.mp4", SourceKind.FILE),
        ("pictures/%04d.jpg", SourceKind.PICTURES),
        ("pictures/%d.png", SourceKind.PICTURES),
        ("100%.mp4", SourceKind.FILE),
    ],
)
def test_kinds(source: str, kind: SourceKind) -> None:
    assert source_kind(source) is kind


def test_schemes() -> None:
    assert scheme("RTSP://camera/stream") == "rtsp"
    assert scheme("clips/top.mp4") == ""


def test_a_device_has_one_identity() -> None:
    assert device_path(BY_ID) == f"/dev/v4l/by-id/{BY_ID}"
    assert device_identity(BY_ID) == device_identity(f"/dev/v4l/by-id/{BY_ID}") != ""
    assert device_identity("/dev//video3") == "3"
    assert device_identity("/dev/camera_top") == "/dev/camera_top"
    assert device_identity("clip.mp4") == device_identity("http://x/y") == ""


@pytest.mark.parametrize(
    "source",
    [BY_ID, "/dev/video3", "/dev//video3", "/dev/camera_top", "clip.mp4", "http://x/y", "p/%04d.jpg"],
)
def test_the_schema_states_the_same_without_this_plugin(source: str) -> None:
    (facts,) = (item for item in field_facts(CameraConfig.DESCRIPTOR) if item.name == "source")
    names: dict[int, SourceKind] = {
        NAMES_DEVICE: SourceKind.DEVICE,
        NAMES_ADDRESS: SourceKind.ADDRESS,
        NAMES_FILES: SourceKind.PICTURES,
        NAMES_FILE: SourceKind.FILE,
    }
    kind, identity = facts.named_by(source)
    assert (names[kind], identity) == (source_kind(source), device_identity(source))

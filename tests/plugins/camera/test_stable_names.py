"""Names that mean one camera at every start: found, and written into a file."""

from __future__ import annotations

import argparse
from pathlib import Path

import pytest
from joshua.cli.doctor.result import Level
from joshua.tools import check, plan
from joshua_camera.commands.write_source import write
from joshua_camera.devices import ambiguous_ids, list_devices
from joshua_camera.doctor import check_cameras_of_file
from joshua_camera.source_text import SourceKind, device_path, source_kind
from joshua_camera.survey import survey
from usb_host import MakeHost
from usb_host import make_host as make_host

BY_ID = "usb-Sonix_USB_2.0_Camera_SN0001-video-index0"

CONFIG = """general {{ mode: MODE_TEST name: "rig" id: "rig" }}
robot {{
  perceptions {{
    node {{ node_name: "top" node_id: 1
      publishers {{ data_type: IMAGE topic_name: "/top/image_raw" publish_rate_hz: 30 }} }}
    perception_type: PERCEPTION_CAMERA
    camera_config {{
      device_id: 0  # the camera above the table
      width: 640 height: 480 fps: 30
    }}
  }}
  perceptions {{
    node {{ node_name: "wrist" node_id: 2
      publishers {{ data_type: IMAGE topic_name: "/wrist/image_raw" publish_rate_hz: 30 }} }}
    perception_type: PERCEPTION_CAMERA
    camera_config {{ device_id: {wrist} width: 640 height: 480 fps: 30 }}
  }}
}}
"""


def plug(root: Path, number: int, *, serial: str = "SN0001", socket: str = "1", by_id: str = "") -> None:
    """Adds a camera as the kernel and udev show it."""
    (root / "dev/v4l/by-path").mkdir(parents=True, exist_ok=True)
    (root / "dev/v4l/by-id").mkdir(parents=True, exist_ok=True)
    (root / f"dev/video{number}").touch()
    usb = root / f"sys/devices/usb1/1-{socket}"
    usb.mkdir(parents=True)
    for name, value in (("idVendor", "0c45"), ("idProduct", "6366"), ("serial", serial)):
        (usb / name).write_text(f"{value}\n")
    video = root / f"sys/class/video4linux/video{number}"
    video.mkdir(parents=True)
    (video / "name").write_text("USB 2.0 Camera: USB Camera\n")
    (video / "device").symlink_to(usb)
    path = root / f"dev/v4l/by-path/pci-0000:00:14.0-usb-0:{socket}:1.0-video-index0"
    path.symlink_to(f"../../video{number}")
    if by_id:
        (root / "dev/v4l/by-id" / by_id).symlink_to(f"../../video{number}")


def options(path: Path, **chosen: object) -> argparse.Namespace:
    """The options of the command."""
    return argparse.Namespace(
        **{"write_to": str(path), "node": "", "camera": "", "show_only": False, **chosen}
    )


def test_cameras_of_one_model_and_serial_number_are_named_by_their_sockets(tmp_path: Path) -> None:
    plug(tmp_path, 0, socket="1")
    plug(tmp_path, 2, socket="2", by_id=BY_ID)
    plug(tmp_path, 4, socket="3", serial="SN0007", by_id=BY_ID.replace("SN0001", "SN0007"))
    entries = list_devices(tmp_path)
    assert ambiguous_ids(entries) == {0, 2}
    assert [entry.usb[2] for entry in entries] == ["SN0001", "SN0001", "SN0007"]
    first, second, third = survey(root=tmp_path)
    assert first.source == "pci-0000:00:14.0-usb-0:1:1.0-video-index0"
    assert second.source == "pci-0000:00:14.0-usb-0:2:1.0-video-index0"
    assert third.source == BY_ID.replace("SN0001", "SN0007")
    for camera in (first, second):
        assert "another camera has the same model and serial number" in camera.note
        assert "plug the camera into the same socket each time" in camera.note
    assert third.note == ""


@pytest.mark.parametrize(
    "name",
    [
        "pci-0000:00:14.0-usb-0:1:1.0-video-index0",
        "platform-fd500000.pcie-pci-0000:01:00.0-usb-0:1.3:1.0-video-index0",
    ],
)
def test_the_name_of_a_socket_is_a_device(tmp_path: Path, name: str) -> None:
    assert source_kind(name) is SourceKind.DEVICE
    assert device_path(name) == f"/dev/v4l/by-path/{name}"
    both = CONFIG.format(wrist=0).replace("device_id: 0 ", f'source: "{name}" ', 2)
    path = tmp_path / "rig.pbtxt"
    path.write_text(both)
    assert [item.code for item in check(path).errors] == ["camera-shared"]


def test_the_names_of_cameras_are_written_into_a_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plug(tmp_path, 0, socket="1")
    plug(tmp_path, 2, socket="2", by_id=BY_ID)
    path = tmp_path / "rig.pbtxt"
    path.write_text(CONFIG.format(wrist=2))
    cameras = survey(root=tmp_path)
    assert write(options(path, show_only=True), cameras, str(tmp_path)) == 0
    assert path.read_text() == CONFIG.format(wrist=2)
    assert write(options(path), cameras, str(tmp_path)) == 0
    text = path.read_text()
    assert 'the table\n      source: "pci-0000:00:14.0-usb-0:1:1.0-video-index0"\n' in text
    assert 'device_id: 2 source: "pci-0000:00:14.0-usb-0:2:1.0-video-index0"' in text
    assert f"{path}: written" in capsys.readouterr().out
    assert check(path).errors == []
    assert write(options(path), cameras, str(tmp_path)) == 0
    assert "already names its cameras" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("chosen", "said"),
    [
        ({}, "wrist: the camera {root}/dev/video7 is not plugged in. Cameras here: {root}/dev/video0"),
        ({"node": "wirst"}, "has no camera node wirst. Its camera nodes: wrist"),
        ({"camera": "/dev/video0"}, "--camera chooses the camera of one node: add --node with one of top"),
    ],
)
def test_what_cannot_be_written_is_named_and_nothing_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], chosen: dict[str, str], said: str
) -> None:
    plug(tmp_path, 0, by_id=BY_ID)
    path = tmp_path / "rig.pbtxt"
    path.write_text(CONFIG.format(wrist=7))
    assert write(options(path, **chosen), survey(root=tmp_path), str(tmp_path)) == 2
    error = capsys.readouterr().err
    assert said.format(root=tmp_path) in error
    assert error.endswith("nothing was written\n")
    assert path.read_text() == CONFIG.format(wrist=7)


def test_without_any_camera_the_remedy_is_to_plug_one_in(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "rig.pbtxt"
    path.write_text(CONFIG.format(wrist=7))
    assert write(options(path), [], str(tmp_path)) == 4
    error = capsys.readouterr().err
    assert "wrist: the camera" in error
    assert "is not plugged in. Plug it in, because this machine has no camera\n" in error


def test_the_doctor_looks_for_the_cameras_of_a_file(tmp_path: Path, make_host: MakeHost) -> None:
    plug(tmp_path, 0, by_id=BY_ID)
    path = tmp_path / "rig.pbtxt"
    path.write_text(CONFIG.format(wrist=7))
    planned = plan(path).plan
    assert planned is not None
    top, wrist = check_cameras_of_file(make_host(), planned)
    assert (top.level, top.subject) == (Level.OK, "/top")
    assert (wrist.level, wrist.subject) == (Level.ERROR, "/wrist")
    assert wrist.message == "its camera /dev/video7 does not exist. Video devices here: /dev/video0"
    assert "joshua find-cameras --write CONFIG --node wrist --camera PATH" in wrist.remedy


def test_a_stream_that_usb_cannot_carry_is_a_warning(tmp_path: Path) -> None:
    path = tmp_path / "rig.pbtxt"
    large = 'width: 1920 height: 1080 fps: 30 pixel_format: "YUYV"'
    path.write_text(CONFIG.format(wrist=2).replace("width: 640 height: 480 fps: 30", large))
    found = check(path)
    assert found.errors == []
    warnings = [item for item in found.diagnostics if item.code == "usb-bandwidth"]
    assert [item.field_path for item in warnings] == [
        "robot.perceptions[0].camera_config.pixel_format",
        "robot.perceptions[1].camera_config.pixel_format",
    ]
    assert "at 30 Hz are 995 Mbit/s, but USB 2.0 carries at most 197 Mbit/s" in warnings[0].message
    small = large.replace("1920", "640").replace("1080", "480")
    path.write_text(CONFIG.format(wrist=2).replace("width: 640 height: 480 fps: 30", small))
    assert check(path).diagnostics == []

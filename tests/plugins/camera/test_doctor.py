"""What ``joshua doctor`` says of cameras, on real file trees."""

from __future__ import annotations

from pathlib import Path

from joshua.cli.doctor.result import Level
from joshua_camera.doctor import check_bandwidth, check_permissions
from usb_host import MakeHost
from usb_host import make_host as make_host


def test_a_camera_that_the_user_may_not_open_is_an_error(tmp_path: Path, make_host: MakeHost) -> None:
    (tmp_path / "dev").mkdir()
    (tmp_path / "dev/video0").touch(0o600)
    (camera,) = check_permissions(make_host())
    assert camera.level is Level.ERROR
    assert camera.subject.endswith("/dev/video0")


def test_cameras_on_one_bus_are_a_note(tmp_path: Path, make_host: MakeHost) -> None:
    (tmp_path / "sys/class/video4linux").mkdir(parents=True)
    for number, place in enumerate(("1-1", "1-3", "2-1")):
        device = tmp_path / "sys/bus/usb/devices" / place
        node = device / f"{place}:1.0/video4linux/video{number}"
        node.mkdir(parents=True)
        (node / "device").symlink_to("../..")
        (device / "idVendor").write_text("046d\n")
        (device / "speed").write_text("480\n")
        (tmp_path / f"sys/class/video4linux/video{number}").symlink_to(node)
    (cameras,) = check_bandwidth(make_host())
    assert (cameras.subject, cameras.level) == ("bus 1", Level.NOTE)
    assert cameras.message.startswith("2 cameras share the 480 Mbit/s of one bus")
    assert "MJPG" in cameras.remedy

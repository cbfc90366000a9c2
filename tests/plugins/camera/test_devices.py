"""The list of video devices, and who holds one."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from joshua_camera.devices import DeviceEntry, holders, list_devices


def test_devices_with_names_and_stable_links(tmp_path: Path) -> None:
    by_id = tmp_path / "dev/v4l/by-id"
    by_id.mkdir(parents=True)
    for number, name in ((0, "HD Webcam C615"), (1, "HD Webcam C615"), (10, "Wrist: Cam ")):
        (tmp_path / f"dev/video{number}").touch()
        (tmp_path / f"sys/class/video4linux/video{number}").mkdir(parents=True)
        (tmp_path / f"sys/class/video4linux/video{number}/name").write_text(f"{name}\n")
    (tmp_path / "dev/video2").touch()
    (tmp_path / "dev/videotape").touch()
    (by_id / "usb-046d_HD_Webcam_C615_1234-video-index0").symlink_to("../../video0")
    (by_id / "usb-046d_HD_Webcam_C615_1234-video-index1").symlink_to("../../video1")
    (by_id / "gone-video-index0").symlink_to("../../video7")
    dev = tmp_path / "dev"
    assert list_devices(tmp_path) == [
        DeviceEntry(0, f"{dev}/video0", "HD Webcam C615", ("usb-046d_HD_Webcam_C615_1234-video-index0",)),
        DeviceEntry(1, f"{dev}/video1", "HD Webcam C615", ("usb-046d_HD_Webcam_C615_1234-video-index1",)),
        DeviceEntry(2, f"{dev}/video2", "", ()),
        DeviceEntry(10, f"{dev}/video10", "Wrist: Cam", ()),
    ]


def test_a_machine_without_devices(tmp_path: Path) -> None:
    assert list_devices(tmp_path) == []


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs /proc")
def test_the_process_that_holds_a_file_is_named(tmp_path: Path) -> None:
    path = tmp_path / "video0"
    path.touch()
    link = tmp_path / "camera_top"
    link.symlink_to(path)
    program = f"import sys; f = open({str(path)!r}); print('open', flush=True); sys.stdin.read()"
    with subprocess.Popen(
        [sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as process:
        assert process.stdout is not None
        process.stdout.readline()
        name = Path(f"/proc/{process.pid}/comm").read_text().strip()
        assert holders(str(path)) == [f"{name} (process {process.pid})"]
        assert holders(str(link)) == holders(str(path))
        process.communicate()
    assert holders(str(path)) == []


def test_this_process_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "video0"
    with path.open("w"):
        assert holders(str(path)) == []

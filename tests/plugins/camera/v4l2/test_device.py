"""Cameras of this machine, through OpenCV's own V4L2 code, on devices emulated at the C library."""

from __future__ import annotations

from pathlib import Path

import pytest
from emulated_v4l2 import AUTO_EXPOSURE, BRIGHTNESS, EXPOSURE, EmulatedDevices

READ = """
c = camera(device_id=0{fields})
c.connect()
readings = [c.read(10) for _ in range({count})]
answer["sequences"] = [r.sequence for r in readings]
answer["age_s"] = (time.time_ns() - readings[-1].stamp_ns) / 1e9
answer["jpeg"] = readings[-1].data.jpeg is not None
answer["shape"] = readings[-1].data.rgb.shape
answer["grey"] = [int(r.data.rgb[200, 300, 1]) for r in readings]
answer["warnings"] = c.warnings
answer["exposure"] = c.figures.exposure
answer["pixel_format"] = c.figures.pixel_format
c.disconnect()
answer["threads"] = [t.name for t in threading.enumerate()]
"""


def read(devices: EmulatedDevices, count: int = 5, fields: str = "") -> dict:
    return devices.run(READ.format(count=count, fields=", " + fields if fields else ""))


def test_pictures_come_as_the_camera_made_them(devices: EmulatedDevices, frame: bytes) -> None:
    devices.add(frame=frame)
    body = READ.format(count=3, fields="") + "answer['bytes'] = len(readings[0].data.jpeg)\n"
    answer = devices.run(body)
    assert answer["bytes"] == len(frame)  # the padding of the buffer is cut off
    assert answer["shape"] == [480, 640, 3]
    assert answer["sequences"] == sorted(set(answer["sequences"]))
    assert answer["pixel_format"] == "MJPG"
    assert answer["warnings"] == []
    assert answer["threads"] == ["MainThread"]


def test_the_stamp_is_the_acquisition_of_the_driver(devices: EmulatedDevices, frame: bytes) -> None:
    devices.add(0, "delay_us 400000", frame=frame)
    assert read(devices)["age_s"] >= 0.4


def test_settings_are_applied_in_order(devices: EmulatedDevices, frame: bytes) -> None:
    devices.add(frame=frame)
    answer = read(devices, fields="brightness=100, exposure=156")
    assert answer["warnings"] == []
    assert answer["exposure"] == "15.6 ms"
    log = devices.log()
    last_format = max(i for i, line in enumerate(log) if line == "format MJPG 640 480")
    last_rate = max(i for i, line in enumerate(log) if line == "rate 30")
    brightness, automatic, exposure = (
        log.index(f"control {number} {value}")
        for number, value in ((BRIGHTNESS, 100), (AUTO_EXPOSURE, 1), (EXPOSURE, 156))
    )
    assert last_format < last_rate < brightness < automatic < exposure < log.index("stream on")


def test_a_negative_exposure_is_the_logarithm_of_seconds(devices: EmulatedDevices, frame: bytes) -> None:
    devices.add(frame=frame)
    assert read(devices, fields="exposure=-6")["warnings"] == []
    assert f"control {EXPOSURE} 156" in devices.log()


def test_what_the_camera_does_not_keep_is_a_warning(devices: EmulatedDevices, frame: bytes) -> None:
    devices.add(frame=frame)
    answer = read(devices, fields='brightness=300, contrast=7, exposure=9000, pixel_format="MJPG"')
    assert answer["warnings"] == [
        "brightness 300was requested, but the camera uses 255 (allowed: 0 to 255)",
        "contrast 7was requested, but the camera has no such control",
        "exposure 9000was requested, but the camera uses 2047 (allowed: 3 to 2047)",
    ]


def test_another_pixel_format_and_rate_are_warnings(devices: EmulatedDevices, frame: bytes) -> None:
    devices.add(modes=("YUYV 640 480 15",))
    answer = read(devices, count=4)
    assert answer["warnings"] == [
        "pixel_format MJPGwas requested, but the camera uses YUYV",
        "fps 30was requested, but the camera uses 15",
    ]
    assert not answer["jpeg"]
    assert answer["shape"] == [480, 640, 3]
    assert len(set(answer["grey"])) == 4  # each picture is a new one


def test_settings_that_are_not_kept_fail_a_test_run(devices: EmulatedDevices) -> None:
    devices.add(modes=("YUYV 640 480 15",))
    body = """
    from joshua.plan import NodeKind, NodeSpec
    from joshua.testing.recording_context import RecordingContext
    from joshua_camera.node import CameraNode
    context = RecordingContext(NodeSpec(
        name="camera", kind=NodeKind.SENSOR, behaviour="joshua_camera.node:CameraNode",
        implementation="joshua_camera.camera:OpenCvCamera",
        settings_type="joshua_camera.settings:CameraSettings",
        settings=camera(device_id=0).settings.model_dump(mode="json"), facts={"testing": True},
    ))
    node = CameraNode(context)
    node.configure()
    answer["table"] = context.warnings
    node.deactivate()
    answer["rows"] = [row for row in node.test_results() if row[0] == "settings kept"]
    node.cleanup()
    """
    answer = devices.run(body)
    assert answer["table"][0] == "pixel_format MJPGwas requested, but the camera uses YUYV"
    assert answer["rows"] == [["settings kept", False, "; ".join(answer["table"])]]


def test_yuyv_is_converted(devices: EmulatedDevices) -> None:
    devices.add()
    answer = read(devices, fields='pixel_format="YUYV"')
    assert answer["warnings"] == []
    assert answer["pixel_format"] == "YUYV"
    assert not answer["jpeg"]


@pytest.fixture(scope="module")
def refusals(v4l2_library: Path, tmp_path_factory: pytest.TempPathFactory, frame: bytes) -> dict[str, str]:
    """What the user reads when a camera cannot be opened, by case; all in one process."""
    devices = EmulatedDevices(tmp_path_factory.mktemp("refusals"), v4l2_library)
    devices.add(0, frame=frame)
    devices.add(1, "metadata")
    devices.add(2, "busy", frame=frame)
    devices.add(3, "deny", frame=frame)
    devices.add(4, modes=("MJPG 320 240 30",), frame=frame)
    body = """
    answer["size"] = refusal(device_id=0, width=1920, height=1080)
    answer["metadata"] = refusal(device_id=1)
    answer["busy"] = refusal(device_id=2)
    answer["denied"] = refusal(device_id=3)
    answer["lie"] = refusal(device_id=4, width=320, height=240)
    answer["missing"] = refusal(device_id=9)
    answer["free again"] = refusal(device_id=0)
    """
    return devices.run(body)


def test_a_size_that_the_camera_does_not_offer(refusals: dict[str, str]) -> None:
    assert refusals["size"] == (
        "/dev/video0 does not offer 1920 × 1080, but delivers 640 × 480: set width and height to a size "
        "that it offers: 640 × 480, 320 × 240"
    )
    assert refusals["free again"] == "connected"


def test_a_camera_that_lies_about_its_size(refusals: dict[str, str]) -> None:
    assert refusals["lie"].startswith("/dev/video4 delivers 640 × 480, and the file asks for 320 × 240")


def test_a_missing_camera(refusals: dict[str, str]) -> None:
    assert refusals["missing"].startswith(
        "/dev/video9 does not exist: plug the camera in, or choose another; "
    )


def test_no_permission(refusals: dict[str, str]) -> None:
    assert refusals["denied"] == (
        "/dev/video3 may not be opened by this user: add the user to the group video "
        "(sudo usermod -aG video $USER) and log in again"
    )


def test_a_busy_camera(refusals: dict[str, str]) -> None:
    assert refusals["busy"] == (
        "/dev/video2 is in use by another process, possibly of another user: end that program, or choose "
        "another camera"
    )


def test_the_metadata_node_of_a_camera(refusals: dict[str, str]) -> None:
    assert refusals["metadata"].startswith(
        "/dev/video1 delivers no pictures: a camera may have more device files, for metadata; "
    )


def test_unplugged_and_plugged_in_again(devices: EmulatedDevices, frame: bytes) -> None:
    devices.add(frame=frame)
    body = f"""
    import os
    c = camera(device_id=0)
    c.connect()
    c.read(10)
    open({str(devices.flag("unplugged"))!r}, "w").close()
    try:
        while True:
            c.read(0.2)
    except DeviceDisconnected as error:
        answer["lost"] = str(error)
    c.disconnect()
    answer["still"] = refusal(device_id=0)
    os.unlink({str(devices.flag("unplugged"))!r})
    c.connect()
    answer["back"] = c.read(10) is not None
    c.disconnect()
    """
    answer = devices.run(body)
    assert answer["lost"] == "/dev/video0 ended its stream: check cable, power and network"
    assert answer["still"].startswith("/dev/video0 does not exist")
    assert answer["back"]


def test_a_device_that_hangs_is_lost_and_can_be_closed_at_once(
    devices: EmulatedDevices, frame: bytes
) -> None:
    devices.add(frame=frame)
    body = f"""
    c = camera(device_id=0)
    c.connect()
    open({str(devices.flag("stalled"))!r}, "w").close()
    try:
        while True:
            c.read(0.2)
    except DeviceDisconnected as error:
        answer["lost"] = str(error)
    began = time.monotonic()
    c.disconnect()
    answer["took_s"] = time.monotonic() - began
    answer["threads"] = [t.name for t in threading.enumerate()]
    """
    answer = devices.run(body)
    assert answer["lost"] == ("/dev/video0 has delivered no picture for 2 s: check cable, power and network")
    assert answer["threads"] == ["MainThread"]
    assert "stream off" in devices.log()


def test_two_cameras_in_one_process(devices: EmulatedDevices, frame: bytes) -> None:
    devices.add(0, frame=frame)
    devices.add(2, frame=frame)
    body = """
    first, second = camera(device_id=0), camera(source="/dev/video2")
    first.connect()
    second.connect()
    answer["both"] = [first.read(10) is not None, second.read(10) is not None]
    first.disconnect()
    answer["other"] = [second.read(10) is not None for _ in range(3)]
    second.disconnect()
    """
    answer = devices.run(body)
    assert answer["both"] == [True, True]
    assert answer["other"] == [True] * 3

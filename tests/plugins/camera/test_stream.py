"""The camera on an emulated network camera: order, faults, ends."""

from __future__ import annotations

import itertools
import re
import threading
import time
from collections.abc import Callable
from typing import Any

import pytest
from eventually import eventually
from joshua.devices.context import SensorContext
from joshua.devices.errors import DeviceDisconnected, DeviceError
from joshua.devices.sensor import Reading
from joshua.guardian.silence import AwakeClock
from joshua.messages import decode, encode
from joshua.messages.make import pixels
from joshua.node.errors import Cancelled
from joshua.plan import SensorFacts
from joshua_camera.camera import CAMERA_INFO, COMPRESSED_IMAGE, IMAGE, OpenCvCamera
from joshua_camera.picture import decode_jpeg
from joshua_emulator import EmulatedCamera
from joshua_emulator.camera.frame_code import FrameCode, read_code

LONG_S = 30.0
Maker = Callable[..., OpenCvCamera]


def next_reading(camera: OpenCvCamera) -> Reading:
    reading = camera.read(LONG_S)
    assert reading is not None
    return reading


def code(reading: Reading) -> FrameCode:
    found = read_code(reading.data.as_rgb())
    assert found is not None
    return found


def until_lost(camera: OpenCvCamera) -> DeviceError:
    with pytest.raises(DeviceError) as caught:
        read_on(camera)
    return caught.value


def read_on(camera: OpenCvCamera) -> None:
    deadline_s = time.monotonic() + LONG_S
    while time.monotonic() < deadline_s:
        camera.read(0.1)


def test_a_run_that_ends_is_not_kept_waiting(emulator: EmulatedCamera, camera_at: Maker) -> None:
    emulator.fault("stall")
    camera = camera_at(emulator.source)
    asked = itertools.count()
    camera.context = SensorContext(SensorFacts(), stopping=lambda: next(asked) > 2)
    with pytest.raises(Cancelled):
        camera.connect()
    assert not camera.connected
    camera.context = SensorContext(SensorFacts())
    emulator.ask("clear_faults")
    camera.connect()


def test_frames_are_new_in_order_and_stamped_when_they_came(
    emulator: EmulatedCamera, camera_at: Maker
) -> None:
    camera = camera_at(emulator.source)
    camera.connect()
    clock_ns = time.time_ns() - time.monotonic_ns()
    readings = [next_reading(camera) for _ in range(60)]
    codes = [code(reading) for reading in readings]
    numbers = [found.number for found in codes]
    assert numbers == sorted(set(numbers))
    assert [reading.sequence for reading in readings] == sorted({reading.sequence for reading in readings})
    # a gap in the sequence is a frame that was lost on the way, and the other way round; a client that was
    # held up is not sent some
    skipped = [entry["number"] for entry in emulator.log("skipped")]
    sent = [n - numbers[0] - sum(numbers[0] < lost < n for lost in skipped) for n in numbers]
    assert sent == [r.sequence - readings[0].sequence for r in readings]
    for reading, found in zip(readings, codes, strict=True):
        assert reading.stamp_ns - clock_ns >= found.sent_ns - 5_000_000


def test_only_the_newest_frame_is_kept(emulator: EmulatedCamera, camera_at: Maker) -> None:
    camera = camera_at(emulator.source)
    camera.connect()
    first = next_reading(camera)
    eventually(lambda: camera.figures.dropped > 20, "pictures that nobody took")
    second = next_reading(camera)
    assert code(second).number > code(first).number + 20


def test_messages(emulator: EmulatedCamera, camera_at: Maker) -> None:
    camera = camera_at(emulator.source)
    camera.connect()
    reading = next_reading(camera)
    raw = decode(IMAGE, encode(camera.message(reading, IMAGE, "camera_top")))
    assert (raw.encoding, raw.width, raw.height, raw.step) == ("rgb8", 320, 240, 960)
    assert raw.header.frame_id == "camera_top"
    assert read_code(pixels(raw)) == code(reading)
    compressed = decode(COMPRESSED_IMAGE, encode(camera.message(reading, COMPRESSED_IMAGE, "camera_top")))
    assert compressed.format == "rgb8; jpeg compressed bgr8"
    decoded = decode_jpeg(compressed.data.tobytes())
    assert decoded is not None
    assert read_code(decoded) == code(reading)
    info = camera.message(reading, CAMERA_INFO, "camera_top")
    assert (info.width, info.height) == (320, 240)
    assert raw.header.stamp == compressed.header.stamp == info.header.stamp


def test_colours_are_rgb(emulator: EmulatedCamera, camera_at: Maker) -> None:
    camera = camera_at(emulator.source)
    camera.connect()
    rgb = next_reading(camera).data.rgb
    # the red block of the scene, where the ball never covers it
    red, _, blue = (int(value) for value in rgb[int(0.48 * 240), int(0.17 * 320)])
    assert red > blue + 100


def test_pictures_that_nobody_wants_as_pixels_are_passed_on_as_they_came(
    emulator: EmulatedCamera, camera_at: Maker
) -> None:
    camera = camera_at(emulator.source, publishes=(COMPRESSED_IMAGE,))
    camera.connect()
    picture = next_reading(camera).data
    assert picture.rgb is None
    assert picture.jpeg.startswith(b"\xff\xd8")
    assert picture.jpeg.endswith(b"\xff\xd9")


def test_a_stall_is_reported_and_the_stream_can_be_opened_again(
    emulator: EmulatedCamera, camera_at: Maker
) -> None:
    camera = camera_at(emulator.source)
    camera.connect()
    next_reading(camera)
    emulator.fault("stall")
    error = until_lost(camera)
    assert isinstance(error, DeviceDisconnected)
    assert str(error) == (
        f"{emulator.source} has delivered no picture for 2 s: check cable, power and network"
    )
    camera.disconnect()
    emulator.ask("clear_faults")
    camera.connect()
    next_reading(camera)


def test_a_machine_that_gives_nobody_its_time_is_no_stall(emulator: EmulatedCamera, camera_at: Maker) -> None:
    camera = camera_at(emulator.source)
    camera.connect()
    emulator.fault("stall")
    while camera.read(0.2) is not None:
        pass
    held_up_s = 0.0
    thread = camera._thread
    assert thread is not None
    thread._awake = AwakeClock(lambda: time.monotonic() + held_up_s)
    thread._heard = (thread._last_ns, thread._awake.now_s())
    held_up_s = 30.0  # the camera has sent nothing meanwhile, for it was held up, too
    camera.read(0.1)
    emulator.ask("clear_faults")
    next_reading(camera)


def test_frames_from_before_a_stall_are_not_shown_after_it(
    emulator: EmulatedCamera, camera_at: Maker
) -> None:
    camera = camera_at(emulator.source)
    camera.connect()
    before = code(next_reading(camera)).number
    emulator.fault("stall", 0.5)
    emulator.wait_for(["go_on"], since=emulator.log("stall")[-1]["sequence"])
    numbers = [code(next_reading(camera)).number for _ in range(20)]
    assert numbers == sorted(set(numbers))
    assert numbers[0] > before


def test_an_unplugged_camera_is_reported_and_comes_back(emulator: EmulatedCamera, camera_at: Maker) -> None:
    camera = camera_at(emulator.source)
    camera.connect()
    next_reading(camera)
    emulator.fault("unplug")
    error = until_lost(camera)
    assert isinstance(error, DeviceDisconnected)
    assert str(error) == f"{emulator.source} ended its stream: check cable, power and network"
    camera.disconnect()
    with pytest.raises(DeviceError) as caught:
        camera.connect()
    assert str(caught.value) == (
        f"{emulator.source} cannot be reached: connection refused at 127.0.0.1 port "
        f"{emulator.ready['port']}: start the stream on the camera or the phone, check the port, and that "
        "both are in the same network"
    )
    emulator.fault("replug")
    camera.connect()
    next_reading(camera)


def test_damaged_frames_are_dropped_and_counted(emulator: EmulatedCamera, camera_at: Maker) -> None:
    camera = camera_at(emulator.source)
    camera.connect()
    emulator.fault("truncate", 0.5)
    codes = [code(next_reading(camera)) for _ in range(30)]
    numbers = [found.number for found in codes]
    assert numbers == sorted(set(numbers))
    assert camera.figures.damaged > 0


def test_corrupt_frames_never_end_the_stream(emulator: EmulatedCamera, camera_at: Maker) -> None:
    camera = camera_at(emulator.source)
    camera.connect()
    emulator.fault("corrupt", 0.5)
    sequences = [next_reading(camera).sequence for _ in range(40)]
    assert sequences == sorted(set(sequences))


def test_a_stream_that_begins_in_the_middle_of_a_picture(emulator: EmulatedCamera, camera_at: Maker) -> None:
    emulator.fault("dirty")
    camera = camera_at(emulator.source)
    camera.connect()
    numbers = [code(next_reading(camera)).number for _ in range(5)]
    assert numbers == sorted(set(numbers))


def test_another_size_is_refused(emulator: EmulatedCamera, camera_at: Maker) -> None:
    camera = camera_at(emulator.source, width=640, height=480)
    with pytest.raises(DeviceError) as caught:
        camera.connect()
    assert str(caught.value) == (
        f"{emulator.source} delivers 320 × 240, and the file asks for 640 × 480: set width: 320 height: 240, "
        "or another size at the camera"
    )
    assert not camera.connected


def test_a_size_that_changes_ends_the_camera(emulator: EmulatedCamera, camera_at: Maker) -> None:
    camera = camera_at(emulator.source)
    camera.connect()
    emulator.ask("fault", kind="size", value="160x120")
    error = until_lost(camera)
    assert "delivers 160 × 120, and the file asks for 320 × 240" in str(error)
    assert not isinstance(error, DeviceDisconnected)


def test_another_rate_shows_in_the_figures(emulator: EmulatedCamera, camera_at: Maker) -> None:
    camera = camera_at(emulator.source)
    emulator.fault("rate", 20)
    camera.connect()
    for _ in range(20):
        next_reading(camera)
    # a machine that stalls delays pictures, which shows in the figures until many others have come
    eventually(lambda: next_reading(camera) and 10 < camera.figures.fps < 40, "the rate of the camera")


def test_controls_have_no_effect_on_a_stream(emulator: EmulatedCamera, camera_at: Maker) -> None:
    camera = camera_at(emulator.source, brightness=3, exposure=-6)
    camera.connect()
    assert camera.warnings == (
        f"brightness, exposure: no effect on {emulator.source}; set it on the camera's own page",
    )


def test_camera_info_without_calibration_is_a_warning(emulator: EmulatedCamera, camera_at: Maker) -> None:
    camera = camera_at(emulator.source, publishes=(IMAGE, CAMERA_INFO))
    camera.connect()
    assert camera.warnings == ("CAMERA_INFO contains no calibration: set intrinsics_file",)


def test_closing_does_not_wait_for_a_stalled_stream(
    emulator: EmulatedCamera, camera_at: Maker, monkeypatch: Any
) -> None:
    monkeypatch.setattr("joshua_camera.stream_capture.stall_limit_s", lambda _: 300.0)  # FFmpeg's patience
    camera = camera_at(emulator.source)
    camera.connect()
    emulator.fault("stall")
    thread = camera._thread
    assert thread is not None
    camera.disconnect()
    eventually(lambda: not thread.alive, "the end of the thread")


def test_a_connection_attempt_can_be_cancelled(emulator: EmulatedCamera, camera_at: Maker) -> None:
    camera = camera_at(emulator.source)
    emulator.fault("stall")
    errors: list[BaseException] = []

    def connect() -> None:
        try:
            camera.connect()
        except DeviceError as error:
            errors.append(error)

    attempt = threading.Thread(target=connect)
    attempt.start()
    while not emulator.ask("state")["streams"]:
        time.sleep(0.005)
    camera.cancel()
    attempt.join(LONG_S)
    assert "was closed while opening" in str(errors[0])
    with pytest.raises(DeviceError, match="is closing: create a new camera object"):
        camera.connect()


def test_no_picture_at_all(emulator: EmulatedCamera, camera_at: Maker, monkeypatch: Any) -> None:
    monkeypatch.setattr("joshua_camera.camera.FIRST_PICTURE_S", 2.0)
    emulator.fault("truncate", 1)
    camera = camera_at(emulator.source)
    with pytest.raises(DeviceError) as caught:
        camera.connect()
    assert "delivered no picture within 2 s" in str(caught.value)
    assert "damaged" in str(caught.value)


def test_a_clock_that_is_set_back_begins_the_stream_anew(
    emulator: EmulatedCamera, camera_at: Maker, monkeypatch: Any
) -> None:
    camera = camera_at(emulator.source)
    camera.connect()
    last_ns = next_reading(camera).stamp_ns
    real_ns = time.time_ns

    class Clock:
        monotonic_ns, monotonic = time.monotonic_ns, time.monotonic

        @staticmethod
        def time_ns() -> int:
            return real_ns() - 3_600_000_000_000

    monkeypatch.setattr("joshua_camera.capture_thread.time", Clock)
    error = until_lost(camera)
    assert isinstance(error, DeviceDisconnected)
    assert re.search(r"was set back by 3\d{3}\.\d s: http\S+ starts its time stamps again", str(error))
    camera.disconnect()
    camera.connect()
    assert next_reading(camera).stamp_ns < last_ns


def test_connecting_twice_is_refused(emulator: EmulatedCamera, camera_at: Maker) -> None:
    camera = camera_at(emulator.source)
    camera.connect()
    with pytest.raises(DeviceError, match="is already open: disconnect first"):
        camera.connect()


def test_intrinsics_are_read_before_the_camera_is_opened(camera_at: Maker) -> None:
    camera = camera_at("http://127.0.0.1:9/", intrinsics_file="/nowhere/top.yaml")
    with pytest.raises(DeviceError, match="cannot be read"):
        camera.connect()

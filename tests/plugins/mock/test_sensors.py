from __future__ import annotations

import math
import struct
import zlib
from typing import Any

import numpy as np
import pytest
from joshua.devices.errors import DeviceError
from joshua.devices.sensor import Reading, Sensor
from joshua.messages import decode, encode
from joshua.schema import config_pb2
from joshua_mock.pattern import MovingPattern, frame_number
from joshua_mock.sensors import (
    CAMERA_INFO,
    COMPRESSED_IMAGE,
    IMAGE,
    JOINT_STATE,
    LASER_SCAN,
    FreeRunningClock,
    MockCamera,
    MockEncoder,
    MockLidar,
    cast_rays,
)
from joshua_mock.settings import MockCameraSettings, MockEncoderSettings, MockLidarSettings
from stepped_time import SteppedTime

pytestmark = pytest.mark.usefixtures("stepped_time")


def camera(width: int = 64, height: int = 48, fps: int = 200) -> MockCamera:
    block = config_pb2.MockCameraConfig(width=width, height=height, fps=fps)
    return MockCamera(MockCameraSettings.from_block(block))


def encoder(**fields: Any) -> MockEncoder:
    node = config_pb2.Node()
    node.publishers.add(publish_rate_hz=200.0)
    block = config_pb2.MockEncoderConfig(**{"resolution": 4096, **fields})
    return MockEncoder(MockEncoderSettings.from_block(block, node))


def lidar_settings(**fields: Any) -> MockLidarSettings:
    node = config_pb2.Node()
    node.publishers.add(publish_rate_hz=100.0)
    block = config_pb2.MockLidarConfig(
        **{"angle_min": -math.pi, "angle_max": math.pi, "range_max": 12, **fields}
    )
    return MockLidarSettings.from_block(block, node)


def next_reading(sensor: Sensor) -> Reading:
    reading = sensor.read(10.0)
    assert reading is not None
    return reading


@pytest.mark.parametrize("make", [camera, encoder, lambda: MockLidar(lidar_settings())])
def test_each_reading_comes_once_in_order(make: Any) -> None:
    sensor = make()
    with pytest.raises(DeviceError, match="the device is not open: call connect first"):
        sensor.read(0.0)
    sensor.connect()
    readings = [next_reading(sensor) for _ in range(10)]
    sensor.disconnect()
    sequences = [reading.sequence for reading in readings]
    assert sequences == sorted(set(sequences))
    assert sequences[0] == 0
    stamps = [reading.stamp_ns for reading in readings]
    assert stamps == sorted(set(stamps))
    assert all(sensor.implausible(reading) == "" for reading in readings)


def test_a_late_reader_gets_the_newest_frame_and_no_bunch(stepped_time: SteppedTime) -> None:
    sensor = camera(fps=100)
    sensor.connect()
    first = next_reading(sensor)
    stepped_time.sleep(0.1)
    late, after = next_reading(sensor), next_reading(sensor)
    assert late.sequence - first.sequence >= 9
    assert after.sequence > late.sequence
    assert (after.stamp_ns - first.stamp_ns) == pytest.approx((after.sequence - first.sequence) * 1e7, abs=5)


def test_no_frame_in_time_is_none() -> None:
    sensor = camera(fps=1)
    sensor.connect()
    assert next_reading(sensor).sequence == 0
    assert sensor.read(0.01) is None


@pytest.mark.parametrize("size", [(16, 16), (64, 48), (640, 480), (17, 333)])
@pytest.mark.parametrize("number", [0, 1, 77, 2**31 + 5, 2**32 - 1])
def test_the_frame_number_stands_in_the_picture(size: tuple[int, int], number: int) -> None:
    frame = MovingPattern(*size).draw(number)
    assert frame.shape == (size[1], size[0], 3)
    assert frame.dtype == np.uint8
    assert frame_number(frame) == number


def test_the_frame_number_survives_noise_and_is_not_made_up() -> None:
    frame = MovingPattern(320, 240).draw(1234)
    noise = np.random.default_rng(0).integers(-60, 60, frame.shape)
    assert frame_number(np.clip(frame + noise, 0, 255).astype(np.uint8)) == 1234
    assert frame_number(np.zeros((240, 320, 3), np.uint8)) is None
    assert frame_number(np.full((240, 320), 255, np.uint8)) is None
    assert frame_number(np.zeros((8, 8, 3), np.uint8)) is None


def test_the_pattern_moves() -> None:
    pattern = MovingPattern(320, 240)
    assert (pattern.draw(1)[100:] != pattern.draw(2)[100:]).any()


def test_the_camera_makes_images_that_carry_their_acquisition() -> None:
    sensor = camera()
    sensor.connect()
    reading = next_reading(sensor)
    message = decode(IMAGE, encode(sensor.message(reading, IMAGE, "optical")))
    assert (message.width, message.height, message.encoding, message.step) == (64, 48, "rgb8", 192)
    assert message.header.frame_id == "optical"
    assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == reading.stamp_ns
    assert frame_number(np.asarray(message.data).reshape(48, 64, 3)) == reading.sequence


def test_the_compressed_image_is_a_png_of_the_same_picture() -> None:
    sensor = camera()
    sensor.connect()
    reading = next_reading(sensor)
    message = decode(COMPRESSED_IMAGE, encode(sensor.message(reading, COMPRESSED_IMAGE, "optical")))
    assert message.format == "rgb8; png"
    assert (decode_png(bytes(message.data)) == reading.data).all()


def test_the_camera_is_a_pinhole() -> None:
    sensor = camera(width=64, height=48)
    sensor.connect()
    reading = next_reading(sensor)
    info = decode(CAMERA_INFO, encode(sensor.message(reading, CAMERA_INFO, "optical")))
    assert (info.width, info.height) == (64, 48)
    camera_matrix = np.asarray(info.k).reshape(3, 3)
    assert (camera_matrix @ [0.0, 0.0, 1.0] == [31.5, 23.5, 1.0]).all(), "straight ahead is the middle"
    assert (np.asarray(info.p).reshape(3, 4)[:, :3] == camera_matrix).all()
    assert not np.any(info.d)
    assert info.header.stamp.sec * 10**9 + info.header.stamp.nanosec == reading.stamp_ns


def decode_png(data: bytes) -> Any:
    """A reader of its own for 8-bit RGB without filters, checking signature, lengths and CRCs."""
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    at, chunks = 8, []
    while at < len(data):
        (length,) = struct.unpack_from(">I", data, at)
        kind, body = data[at + 4 : at + 8], data[at + 8 : at + 8 + length]
        assert struct.unpack_from(">I", data, at + 8 + length)[0] == zlib.crc32(kind + body)
        chunks.append((kind, body))
        at += 12 + length
    assert [kind for kind, _ in chunks] == [b"IHDR", b"IDAT", b"IEND"]
    width, height, depth, colour, *_ = struct.unpack(">IIBBBBB", chunks[0][1])
    assert (depth, colour) == (8, 2)
    rows = np.frombuffer(zlib.decompress(chunks[1][1]), np.uint8).reshape(height, 1 + 3 * width)
    assert (rows[:, 0] == 0).all()
    return rows[:, 1:].reshape(height, width, 3)


@pytest.mark.parametrize(("inverted", "sign"), [(False, 1), (True, -1)])
def test_the_encoder_turns_at_its_speed_in_whole_ticks(
    inverted: bool, sign: int, stepped_time: SteppedTime
) -> None:
    sensor = encoder(speed_rad_s=100.0, inverted=inverted)
    sensor.connect()
    first = next_reading(sensor)
    stepped_time.sleep(0.05)
    last = next_reading(sensor)
    assert first.data.ticks == 0
    elapsed_s = (last.stamp_ns - first.stamp_ns) / 1e9
    assert last.data.position_rad == pytest.approx(sign * 100.0 * elapsed_s, abs=math.tau / 4096)
    assert last.data.ticks * math.tau / 4096 == pytest.approx(last.data.position_rad)
    assert last.data.velocity_rad_s == sign * 100.0


def test_the_encoder_speaks_of_one_joint() -> None:
    sensor = encoder(speed_rad_s=50.0)
    sensor.connect()
    next_reading(sensor)
    reading = next_reading(sensor)
    state = decode(JOINT_STATE, encode(sensor.message(reading, JOINT_STATE, "base")))
    assert state.name == ["joint_1"]
    assert state.position[0] == reading.data.position_rad
    assert state.velocity[0] == 50.0


def test_the_scan_shows_the_walls_of_the_room() -> None:
    settings = lidar_settings(num_beams=5, room_length_m=4.0, room_width_m=3.0)
    # beams at -180°, -90°, 0°, 90°, 180°
    assert cast_rays(settings) == pytest.approx([2.0, 1.5, 2.0, 1.5, 2.0])
    corner = lidar_settings(angle_min=0, angle_max=math.atan2(1.5, 2.0), num_beams=2)
    assert cast_rays(corner)[1] == pytest.approx(2.5, abs=1e-5)


def test_ranges_outside_the_scanner_are_infinite_by_rep_117() -> None:
    settings = lidar_settings(num_beams=5, range_min=1.6, range_max=1.9)
    assert list(cast_rays(settings)) == [np.inf, -np.inf, np.inf, -np.inf, np.inf]


def test_the_scan_message_describes_its_beams() -> None:
    sensor = MockLidar(lidar_settings(num_beams=181, angle_min=0.0))
    sensor.connect()
    reading = next_reading(sensor)
    scan = decode(LASER_SCAN, encode(sensor.message(reading, LASER_SCAN, "laser")))
    assert len(scan.ranges) == 181
    assert scan.angle_min + 180 * scan.angle_increment == pytest.approx(scan.angle_max, abs=1e-4)
    assert scan.scan_time == pytest.approx(0.01)
    assert scan.range_max == 12.0
    assert scan.header.frame_id == "laser"


def test_implausible_readings_are_named() -> None:
    sensor = MockLidar(lidar_settings(range_min=1.0))
    text = sensor.implausible(Reading(0, 0, np.array([0.5, 2.0, 13.0, np.inf, -np.inf, np.nan], np.float32)))
    assert text == "2 ranges lie outside 1.0 m to 12.0 m"
    wrong = Reading(0, 7, MovingPattern(64, 48).draw(8))
    assert camera().implausible(wrong) == "frame 7 shows the number 8"


def test_the_clock_does_not_drift(stepped_time: SteppedTime) -> None:
    started = stepped_time.monotonic()
    clock = FreeRunningClock(200.0)
    ticks = [clock.wait(5.0) for _ in range(40)]
    first, last = ticks[0], ticks[-1]
    assert first is not None
    assert last is not None
    assert last[1] - first[1] == pytest.approx((last[0] - first[0]) * 5e6, abs=5)
    # a reader cannot be ahead of the clock
    assert last[0] <= (stepped_time.monotonic() - started) * 200.0 + 1
    assert abs(last[1] - stepped_time.time_ns()) < 5e9

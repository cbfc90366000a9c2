"""Virtual sensors at a fixed rate: a camera, a rotary encoder and a laser scanner."""

from __future__ import annotations

import math
import struct
import time
import zlib
from abc import abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from joshua.api import DeviceError, Reading, Sensor, SensorContext
from joshua.api.calibration import ticks_to_rad
from joshua.api.clocks import ros_time
from joshua.messages import message_class
from joshua.messages.make import header, image, joint_state

from joshua_mock.pattern import MovingPattern, frame_number
from joshua_mock.settings import MockCameraSettings, MockEncoderSettings, MockLidarSettings

NS_PER_S = 1_000_000_000

IMAGE = "sensor_msgs/msg/Image"
COMPRESSED_IMAGE = "sensor_msgs/msg/CompressedImage"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
JOINT_STATE = "sensor_msgs/msg/JointState"
LASER_SCAN = "sensor_msgs/msg/LaserScan"


class FreeRunningClock:
    """Acquisition clock of a sensor that runs whether or not it is read.

    Acquisition k happens at start + k·period on the monotonic clock. A late reader gets the newest one; those
    in between are lost, never delivered in a burst.

    Args:
        rate_hz: acquisitions per second.
    """

    def __init__(self, rate_hz: float) -> None:
        self._period_ns = NS_PER_S / rate_hz
        wall_ns = time.time_ns()  # first: even after a stall between the two, no stamp may be in the future
        self._start_ns = time.monotonic_ns()
        self._epoch_ns = wall_ns - self._start_ns
        self._next = 0

    def wait(self, timeout_s: float) -> tuple[int, int] | None:
        """Wait for the next acquisition. Returns its number and stamp; None after the timeout."""
        now_ns = time.monotonic_ns()
        due_ns = self._start_ns + round(self._next * self._period_ns)
        if now_ns < due_ns:
            wait_ns = due_ns - now_ns
            if wait_ns > timeout_s * NS_PER_S:
                time.sleep(max(timeout_s, 0.0))
                return None
            time.sleep(wait_ns / NS_PER_S)
            now_ns = time.monotonic_ns()
        newest = max(self._next, int((now_ns - self._start_ns) / self._period_ns))
        self._next = newest + 1
        if ros_time.is_simulated():
            return newest, ros_time.now_ns()
        return newest, self._epoch_ns + self._start_ns + round(newest * self._period_ns)


class FreeRunningSensor(Sensor):
    """A virtual sensor that acquires at its rate from ``connect`` on."""

    def __init__(self, settings: Any, context: SensorContext | None = None) -> None:
        super().__init__(settings, context)
        self._clock: FreeRunningClock | None = None

    @abstractmethod
    def start(self) -> float:
        """Reset the device. Returns its rate in Hz."""

    @abstractmethod
    def acquire(self, sequence: int, stamp_ns: int) -> Any:
        """Make the data of one acquisition."""

    @property
    def connected(self) -> bool:
        """Whether the sensor runs."""
        return self._clock is not None

    def connect(self) -> None:
        """Start the sensor."""
        if self.connected:
            raise DeviceError(f"{type(self).__name__}.connect: the device is already open")
        self._clock = FreeRunningClock(self.start())

    def read(self, timeout_s: float) -> Reading | None:
        """Wait for the next acquisition; return None after the timeout."""
        self.require_connected("read")
        assert self._clock is not None
        tick = self._clock.wait(timeout_s)
        return None if tick is None else Reading(tick[1], tick[0], self.acquire(*tick))

    def disconnect(self) -> None:
        """Stop the sensor. Idempotent."""
        self._clock = None


class MockCamera(FreeRunningSensor):
    """A virtual camera with a moving test pattern that carries its frame number.

    ``Reading.data`` is a picture of shape (H, W, 3), uint8, RGB. Compressed pictures are PNG files. Its
    CameraInfo is that of a pinhole without distortion, with a focal length of the picture's width.
    """

    settings: MockCameraSettings
    data_types = (IMAGE, COMPRESSED_IMAGE, CAMERA_INFO)

    def start(self) -> float:
        """Make the pattern."""
        self._pattern = MovingPattern(self.settings.width, self.settings.height)
        return self.settings.fps

    def acquire(self, sequence: int, stamp_ns: int) -> npt.NDArray[np.uint8]:
        """Draw the frame with the number of the acquisition."""
        del stamp_ns
        return self._pattern.draw(sequence)

    def message(self, reading: Reading, type_name: str, frame_id: str) -> Any:
        """Make an ``Image`` (rgb8), a ``CompressedImage`` (PNG) or a ``CameraInfo``."""
        if type_name == CAMERA_INFO:
            return self._camera_info(reading, frame_id)
        if type_name == COMPRESSED_IMAGE:
            data = np.frombuffer(encode_png(reading.data), np.uint8)
            return message_class(COMPRESSED_IMAGE)(header(frame_id, reading.stamp_ns), "rgb8; png", data)
        return image(reading.data, frame_id=frame_id, at_ns=reading.stamp_ns)

    def _camera_info(self, reading: Reading, frame_id: str) -> Any:
        width, height = self.settings.width, self.settings.height
        camera = np.array([[width, 0, (width - 1) / 2], [0, width, (height - 1) / 2], [0, 0, 1]], np.float64)
        return message_class(CAMERA_INFO)(
            header=header(frame_id, reading.stamp_ns),
            height=height,
            width=width,
            distortion_model="plumb_bob",
            d=np.zeros(5),
            k=camera.reshape(-1),
            r=np.eye(3).reshape(-1),
            p=np.hstack((camera, np.zeros((3, 1)))).reshape(-1),
            binning_x=0,
            binning_y=0,
            roi=message_class("sensor_msgs/msg/RegionOfInterest")(0, 0, 0, 0, False),
        )

    def implausible(self, reading: Reading) -> str:
        """Report a picture that carries the number of another frame."""
        shown = frame_number(reading.data)
        return "" if shown == reading.sequence else f"frame {reading.sequence} shows the number {shown}"


def encode_png(pixels: npt.NDArray[np.uint8]) -> bytes:
    """Encode a picture of shape (H, W, 3), RGB, as a PNG file without a library."""
    height, width = pixels.shape[:2]
    rows = np.insert(pixels.reshape(height, 3 * width), 0, 0, axis=1)  # a row starts with its filter: none
    size = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    data = zlib.compress(rows.tobytes(), level=1)  # the fastest level: a stream, not an archive
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        for kind, body in ((b"IHDR", size), (b"IDAT", data), (b"IEND", b""))
    )


@dataclass(frozen=True)
class EncoderReading:
    """State of a rotary encoder since it was opened: counts over several turns, rad, and rad/s."""

    ticks: int
    position_rad: float
    velocity_rad_s: float


class MockEncoder(FreeRunningSensor):
    """A virtual rotary encoder that turns at constant speed; ``Reading.data`` is an ``EncoderReading``."""

    settings: MockEncoderSettings
    data_types = (JOINT_STATE,)

    def start(self) -> float:
        """Reset the count to 0."""
        self._first_ns: int | None = None
        return self.settings.sample_rate_hz

    def acquire(self, sequence: int, stamp_ns: int) -> EncoderReading:
        """Return the state of the shaft."""
        del sequence
        if self._first_ns is None:
            self._first_ns = stamp_ns
        settings = self.settings
        speed = -settings.speed_rad_s if settings.inverted else settings.speed_rad_s
        turned_rad = speed * (stamp_ns - self._first_ns) / NS_PER_S
        ticks = math.floor(turned_rad * settings.resolution / math.tau)
        position = ticks_to_rad(ticks, ticks_per_turn=settings.resolution, zero_ticks=0)
        return EncoderReading(ticks, position, speed)

    def message(self, reading: Reading, type_name: str, frame_id: str) -> Any:
        """Make a JointState of one joint."""
        del type_name  # there is only one
        data: EncoderReading = reading.data
        return joint_state(
            ["joint_1"], [data.position_rad], [data.velocity_rad_s], frame_id=frame_id, at_ns=reading.stamp_ns
        )


class MockLidar(FreeRunningSensor):
    """A virtual laser scanner in the middle of a rectangular room.

    ``Reading.data`` holds the ranges in metres, shape (num_beams,), float32, by REP 117: -inf is nearer than
    the scanner measures, +inf is farther, NaN would be a failed measurement.
    """

    settings: MockLidarSettings
    data_types = (LASER_SCAN,)

    def start(self) -> float:
        """Start scanning."""
        return self.settings.scan_rate_hz

    def acquire(self, sequence: int, stamp_ns: int) -> npt.NDArray[np.float32]:
        """Return one scan of the room, in which nothing moves."""
        del sequence, stamp_ns
        return cast_rays(self.settings)

    def message(self, reading: Reading, type_name: str, frame_id: str) -> Any:
        """Make a LaserScan; beams of one scan count as simultaneous."""
        settings = self.settings
        return message_class(type_name)(
            header=header(frame_id, reading.stamp_ns),
            angle_min=settings.angle_min_rad,
            angle_max=settings.angle_max_rad,
            angle_increment=(settings.angle_max_rad - settings.angle_min_rad) / (settings.num_beams - 1),
            time_increment=0.0,
            scan_time=1.0 / settings.scan_rate_hz,
            range_min=settings.range_min_m,
            range_max=settings.range_max_m,
            ranges=reading.data,
            intensities=np.zeros(0, np.float32),
        )

    def implausible(self, reading: Reading) -> str:
        """Report a range that is neither a measurement nor a value of REP 117."""
        ranges = reading.data
        low, high = np.float32(self.settings.range_min_m), np.float32(self.settings.range_max_m)
        measured = ranges[np.isfinite(ranges)]
        outside = measured[(measured < low) | (measured > high)]
        return f"{len(outside)} ranges lie outside {low} m to {high} m" if len(outside) else ""


def cast_rays(settings: MockLidarSettings) -> npt.NDArray[np.float32]:
    """Return the distances from the room's middle to its walls in metres, shape (num_beams,), by REP 117."""
    angles = np.linspace(settings.angle_min_rad, settings.angle_max_rad, settings.num_beams)
    with np.errstate(divide="ignore"):
        to_end = settings.room_length_m / 2 / np.abs(np.cos(angles))
        to_side = settings.room_width_m / 2 / np.abs(np.sin(angles))
    ranges = np.minimum(to_end, to_side)
    ranges[ranges < settings.range_min_m] = -np.inf
    ranges[ranges > settings.range_max_m] = np.inf
    return ranges.astype(np.float32)

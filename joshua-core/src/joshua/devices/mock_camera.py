"""A virtual camera: a moving test pattern that carries its frame number."""

from __future__ import annotations

from typing import Any

import numpy as np

from joshua.devices.errors import DeviceError
from joshua.devices.mock_settings import MockCameraSettings
from joshua.devices.pacing import FreeRunningClock
from joshua.devices.pattern import MovingPattern, frame_number
from joshua.devices.png import encode_png
from joshua.devices.sensor import Reading, Sensor
from joshua.messages import message_class
from joshua.messages.make import header, image

IMAGE = "sensor_msgs/msg/Image"
COMPRESSED_IMAGE = "sensor_msgs/msg/CompressedImage"


class MockCamera(Sensor):
    """A virtual camera.

    ``Reading.data`` is a picture of shape (H, W, 3), uint8, RGB. Compressed pictures are PNG files.

    Args:
        settings: size and rate.
        context: further facts of the plan; not used.
    """

    settings: MockCameraSettings

    def __init__(self, settings: MockCameraSettings, context: dict[str, Any] | None = None) -> None:
        super().__init__(settings, context)
        self._clock: FreeRunningClock | None = None
        self._pattern: MovingPattern | None = None

    @property
    def data_types(self) -> tuple[str, ...]:
        """Raw and compressed pictures."""
        return (IMAGE, COMPRESSED_IMAGE)

    @property
    def connected(self) -> bool:
        """Whether the camera runs."""
        return self._clock is not None

    def connect(self) -> None:
        """Starts the camera."""
        if self.connected:
            raise DeviceError("MockCamera.connect: the device is open already")
        self._pattern = MovingPattern(self.settings.width, self.settings.height)
        self._clock = FreeRunningClock(self.settings.fps)

    def read(self, timeout_s: float) -> Reading | None:
        """Waits for the next frame; None when none came in time."""
        self.require_connected("read")
        clock, pattern = self._clock, self._pattern
        assert clock is not None
        assert pattern is not None
        tick = clock.wait(timeout_s)
        if tick is None:
            return None
        return Reading(tick.stamp_ns, tick.sequence, pattern.draw(tick.sequence))

    def message(self, reading: Reading, type_name: str, frame_id: str) -> Any:
        """Makes an ``Image`` (rgb8) or a ``CompressedImage`` (PNG)."""
        if type_name == COMPRESSED_IMAGE:
            data = np.frombuffer(encode_png(reading.data), np.uint8)
            return message_class(COMPRESSED_IMAGE)(header(frame_id, reading.stamp_ns), "rgb8; png", data)
        return image(reading.data, frame_id=frame_id, at_ns=reading.stamp_ns)

    def implausible(self, reading: Reading) -> str:
        """Says when the number in the picture is not the frame's."""
        shown = frame_number(reading.data)
        return "" if shown == reading.sequence else f"frame {reading.sequence} shows the number {shown}"

    def disconnect(self) -> None:
        """Stops the camera; a second call does nothing."""
        self._clock = self._pattern = None

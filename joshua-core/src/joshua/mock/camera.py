"""A virtual camera: a moving test pattern that carries its frame number."""

from __future__ import annotations

import struct
import zlib
from typing import Any

import numpy as np
import numpy.typing as npt

from joshua.devices.sensor import Reading
from joshua.messages import message_class
from joshua.messages.make import header, image
from joshua.mock.pacing import FreeRunningSensor, Tick
from joshua.mock.pattern import MovingPattern, frame_number
from joshua.mock.settings import MockCameraSettings

IMAGE = "sensor_msgs/msg/Image"
COMPRESSED_IMAGE = "sensor_msgs/msg/CompressedImage"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"


def encode_png(pixels: npt.NDArray[np.uint8]) -> bytes:
    """Encodes a picture of shape (H, W, 3), RGB, as a PNG file, so that the core needs no library for it."""
    height, width = pixels.shape[:2]
    rows = np.insert(pixels.reshape(height, 3 * width), 0, 0, axis=1)  # a row starts with its filter: none
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    data = zlib.compress(rows.tobytes(), level=1)  # the fastest level: a stream, not an archive
    chunks = ((b"IHDR", header), (b"IDAT", data), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        for kind, body in chunks
    )


class MockCamera(FreeRunningSensor):
    """A virtual camera.

    ``Reading.data`` is a picture of shape (H, W, 3), uint8, RGB. Compressed pictures are PNG files. Its
    CameraInfo is that of a pinhole without distortion, whose focal length is the width of the picture.

    Args:
        settings: size and rate.
        context: of the node that drives it.
    """

    settings: MockCameraSettings

    @property
    def data_types(self) -> tuple[str, ...]:
        """Raw and compressed pictures, and the camera's geometry."""
        return (IMAGE, COMPRESSED_IMAGE, CAMERA_INFO)

    def start(self) -> float:
        """Makes the pattern."""
        self._pattern = MovingPattern(self.settings.width, self.settings.height)
        return self.settings.fps

    def acquire(self, tick: Tick) -> npt.NDArray[np.uint8]:
        """The frame with the number of the acquisition."""
        return self._pattern.draw(tick.sequence)

    def message(self, reading: Reading, type_name: str, frame_id: str) -> Any:
        """Makes an ``Image`` (rgb8), a ``CompressedImage`` (PNG) or a ``CameraInfo``."""
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
        """Says when the number in the picture is not the frame's."""
        shown = frame_number(reading.data)
        return "" if shown == reading.sequence else f"frame {reading.sequence} shows the number {shown}"

"""The camera as a sensor."""

from __future__ import annotations

import threading
import time
from typing import Any

import numpy as np
from joshua.api import DeviceError, Reading, Sensor, SensorContext
from joshua.messages import message_class
from joshua.messages.make import header, image

from joshua_camera.camera_info import Intrinsics, camera_info, load_intrinsics, uncalibrated
from joshua_camera.capture import Capture
from joshua_camera.capture_thread import CaptureThread
from joshua_camera.device_capture import DeviceCapture
from joshua_camera.figures import FigureKeeper, Figures
from joshua_camera.file_capture import FileCapture
from joshua_camera.limits import FIRST_PICTURE_S, NEXT_FIRST_PICTURE_S
from joshua_camera.picture import Picture
from joshua_camera.settings import CameraSettings
from joshua_camera.source import CameraSource
from joshua_camera.source_text import SourceKind
from joshua_camera.stream_capture import StreamCapture

IMAGE = "sensor_msgs/msg/Image"
COMPRESSED_IMAGE = "sensor_msgs/msg/CompressedImage"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"

#: ROS 2 image_transport format: decoded encoding, and how the picture is stored.
JPEG_FORMAT = "rgb8; jpeg compressed bgr8"

_CAPTURES: dict[SourceKind, type[Capture]] = {
    SourceKind.DEVICE: DeviceCapture,
    SourceKind.ADDRESS: StreamCapture,
    SourceKind.FILE: FileCapture,
    SourceKind.PICTURES: FileCapture,
}


class OpenCvCamera(Sensor):
    """A camera read by OpenCV.

    ``Reading.data`` is a ``Picture``. ``Reading.sequence`` counts all pictures from the camera, so a gap
    means dropped, stale or damaged pictures. Images are ``rgb8``, compressed images are JPEG.

    Args:
        settings: of the camera.
        context: of the node that drives it.
    """

    settings: CameraSettings

    def __init__(self, settings: CameraSettings, context: SensorContext | None = None) -> None:
        super().__init__(settings, context)
        self.source = CameraSource.of(settings)
        self._thread: CaptureThread | None = None
        self._lock = threading.Lock()
        self._cancelled = False
        self._opened_before = False
        self._intrinsics: Intrinsics | None = None
        self._warnings: tuple[str, ...] = ()
        self._refused: tuple[str, ...] = ()
        self._figures = FigureKeeper()
        # Without a node's list of types any type may be requested, pixels included.
        self._needs_pixels = not settings.publishes or IMAGE in settings.publishes or settings.display

    @property
    def data_types(self) -> tuple[str, ...]:
        """ROS 2 types: raw and compressed images, and the camera's calibration."""
        return (IMAGE, COMPRESSED_IMAGE, CAMERA_INFO)

    @property
    def connected(self) -> bool:
        """Whether the camera is open."""
        return self._thread is not None

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about the settings, available after the camera is open."""
        return self._warnings

    @property
    def refused(self) -> tuple[str, ...]:
        """Warnings about settings that the camera did not apply."""
        return self._refused

    @property
    def figures(self) -> Figures:
        """Statistics since the camera was last opened."""
        return self._figures.figures()

    def connect(self) -> None:
        """Open the camera and wait for its first picture.

        Raises:
            DeviceError: the camera is missing, busy, forbidden, has another size or sends nothing, or the
                intrinsics are wrong. The message names the camera and the remedy.
            Cancelled: the run ends.
        """
        if self.connected:
            raise DeviceError(f"{self.source.label} is already open: disconnect first")
        warnings = self._load_intrinsics()
        thread = CaptureThread(_CAPTURES[self.source.kind](self.source, self.settings))
        with self._lock:
            if self._cancelled:
                raise DeviceError(f"{self.source.label} is closing: create a new camera object")
            self._thread = thread
        try:
            thread.open(
                NEXT_FIRST_PICTURE_S if self._opened_before else FIRST_PICTURE_S, self.context.stopping
            )
        except BaseException:
            self._thread = None
            raise
        self._opened_before = True
        self._figures = thread.figures
        self._refused = thread.refused
        self._warnings = (*thread.refused, *thread.notes, *warnings)

    def read(self, timeout_s: float) -> Reading | None:
        """Wait for the next picture.

        Raises:
            DeviceDisconnected: the camera was unplugged, ended its stream or stalled.
            DeviceError: the camera changed the size of its pictures.
        """
        self.require_connected("read")
        thread = self._thread
        assert thread is not None
        deadline_s = time.monotonic() + timeout_s
        while (newest := thread.take(max(0.0, deadline_s - time.monotonic()))) is not None:
            picture = newest.picture
            if self._needs_pixels:
                pixels = picture.as_rgb()
                if pixels is None:
                    thread.figures.damaged += 1
                    continue
                picture = Picture(rgb=pixels, jpeg=picture.jpeg)
            thread.figures.handed_over(time.monotonic_ns() - newest.acquired_ns)
            return Reading(newest.stamp_ns, newest.number, picture)
        return None

    def message(self, reading: Reading, type_name: str, frame_id: str) -> Any:
        """Make an ``Image`` (rgb8), a ``CompressedImage`` (JPEG) or a ``CameraInfo``."""
        picture: Picture = reading.data
        if type_name == CAMERA_INFO:
            intrinsics = self._intrinsics or uncalibrated(self.settings.width, self.settings.height)
            return camera_info(intrinsics, header(frame_id, reading.stamp_ns))
        if type_name == COMPRESSED_IMAGE:
            data = np.frombuffer(picture.as_jpeg(), np.uint8)
            return message_class(COMPRESSED_IMAGE)(header(frame_id, reading.stamp_ns), JPEG_FORMAT, data)
        return image(picture.as_rgb(), frame_id=frame_id, at_ns=reading.stamp_ns)

    def cancel(self) -> None:
        """Abort a waiting ``connect`` or ``read`` permanently because the node stops. Thread-safe."""
        with self._lock:
            self._cancelled = True
            thread = self._thread
        if thread is not None:
            thread.interrupt()

    def disconnect(self) -> None:
        """Close the camera. Idempotent."""
        with self._lock:
            thread, self._thread = self._thread, None
        if thread is not None:
            thread.close()

    def _load_intrinsics(self) -> list[str]:
        """Read the calibration; return a note for the start-up table."""
        settings = self.settings
        if settings.intrinsics_file:
            self._intrinsics = load_intrinsics(settings.intrinsics_file, settings.width, settings.height)
        elif CAMERA_INFO in settings.publishes:
            return ["CAMERA_INFO contains no calibration: set intrinsics_file"]
        return []

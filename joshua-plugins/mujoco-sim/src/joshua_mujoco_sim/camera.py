"""A camera of the model as a sensor, at a rate of simulated time."""

from __future__ import annotations

import io
import math
import threading
from typing import Any

import numpy as np
from joshua.api import ConfigurationError, DeviceError, Reading, Sensor, SensorContext
from joshua.messages import message_class
from joshua.messages.make import header, image
from PIL import Image

from joshua_mujoco_sim.cameras import field_of_view_rad
from joshua_mujoco_sim.physics import Physics
from joshua_mujoco_sim.rendering import CameraRenderer
from joshua_mujoco_sim.settings import SimCameraSettings, SimulationSettings
from joshua_mujoco_sim.world import World, leave_world, shared_world

IMAGE = "sensor_msgs/msg/Image"
COMPRESSED_IMAGE = "sensor_msgs/msg/CompressedImage"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"


#: Polling period of the drawing thread for its end.
LEAVING_CHECK_S = 0.1


class SimCamera(Sensor):
    """A camera of the simulated model.

    ``Reading.data`` is a picture of shape (H, W, 3), uint8, RGB. Compressed pictures are PNG files. The
    CameraInfo is that of a pinhole camera with the model camera's vertical field of view.

    Args:
        settings: camera, size and rate.
        context: of its node, whose facts hold the settings of the simulation.
    """

    settings: SimCameraSettings

    def __init__(self, settings: SimCameraSettings, context: SensorContext | None = None) -> None:
        super().__init__(settings, context)
        self._world: World | None = None
        self._thread: threading.Thread | None = None
        self._due = threading.Event()
        self._ready = threading.Event()
        self._leaving = threading.Event()
        self._drawn = threading.Condition()
        self._newest: Reading | None = None
        self._renderer: CameraRenderer | None = None
        self._taken = (0, 0)
        self._drawing = self._late = False
        self._error: DeviceError | None = None
        self._due_at = 0
        self._frame = 0
        self._last_time_s = 0.0
        self._stamps = self.context.clock
        self._unhook: Any = None

    @property
    def data_types(self) -> tuple[str, ...]:
        """Message types: raw and compressed images, and the camera's geometry."""
        return (IMAGE, COMPRESSED_IMAGE, CAMERA_INFO)

    @property
    def connected(self) -> bool:
        """Whether this is part of a running simulation."""
        return self._world is not None

    def connect(self) -> None:
        """Join the simulation of this process. Raises DeviceError, ConfigurationError for a wrong model."""
        if self.connected:
            raise DeviceError("SimCamera.connect: the device is already open")
        simulation = self.context.facts.simulation
        if not simulation:
            raise ConfigurationError("SimCamera.connect: the configuration has no simulation block: add one")
        world = shared_world(SimulationSettings.model_validate(simulation).world())
        with world.lock:
            self._last_time_s = world.physics.time_s
            self._due_at = self._due_from(self._last_time_s)
        self._world, self._frame, self._newest, self._error = world, 0, None, None
        self._renderer, self._drawing, self._late = None, False, False
        self._leaving.clear()
        self._thread = threading.Thread(target=self._draw_all, args=(world,), name="render", daemon=True)
        self._thread.start()
        self._ready.wait()
        try:
            self._check_drawing()
        except DeviceError:
            self.disconnect()
            raise
        self._unhook = world.after_step(self._watch)
        world.start()

    def read(self, timeout_s: float) -> Reading | None:
        """Wait for the next frame; None if none arrives in time. Raises DeviceError."""
        self.require_connected("read")
        assert self._world is not None
        if self._world.failure:
            raise DeviceError(self._world.failure)
        self._check_drawing()
        with self._drawn:
            self._drawn.wait_for(lambda: self._newest is not None, timeout_s)
            reading, self._newest = self._newest, None
        return reading

    def message(self, reading: Reading, type_name: str, frame_id: str) -> Any:
        """Return an ``Image`` (rgb8), a ``CompressedImage`` (PNG) or a ``CameraInfo``."""
        if type_name == CAMERA_INFO:
            return self._camera_info(reading, frame_id)
        if type_name == COMPRESSED_IMAGE:
            data = io.BytesIO()
            Image.fromarray(reading.data).save(data, format="PNG", compress_level=1)  # a stream
            encoded = np.frombuffer(data.getvalue(), np.uint8)
            return message_class(COMPRESSED_IMAGE)(header(frame_id, reading.stamp_ns), "rgb8; png", encoded)
        return image(reading.data, frame_id=frame_id, at_ns=reading.stamp_ns)

    def disconnect(self) -> None:
        """Leave the simulation. Idempotent."""
        world, self._world = self._world, None
        if world is None:
            return
        if self._unhook is not None:
            self._unhook()
            self._unhook = None
        self._leaving.set()
        self._due.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        self._ready.clear()
        self._due.clear()
        leave_world(world)

    def _check_drawing(self) -> None:
        """Raise what has stopped the drawing thread."""
        if self._error is not None:
            raise self._error

    def _draw_all(self, world: World) -> None:
        """Draw each due frame on a dedicated thread, because an OpenGL context belongs to one thread."""
        size = self.settings
        try:
            renderer = CameraRenderer(
                world.physics.model, size.camera, size.width, size.height, shadows=world.settings.shadows
            )
        except ConfigurationError as error:
            self._error = error
            self._ready.set()
            return
        except Exception as error:  # noqa: BLE001 (connect waits for the renderer, whatever stops it)
            self._error = DeviceError(str(error))
            self._ready.set()
            return
        self._renderer = renderer
        self._ready.set()
        try:
            while not self._leaving.is_set():
                if not self._due.wait(LEAVING_CHECK_S):
                    continue
                self._due.clear()
                if self._leaving.is_set():
                    break
                stamp_ns, sequence = self._taken
                reading = Reading(stamp_ns, sequence, renderer.draw())
                self._drawing = False
                with self._drawn:
                    self._newest = reading
                    self._drawn.notify()
        except Exception as error:  # noqa: BLE001 (read says what stopped the pictures)
            self._error = DeviceError(f"the camera {size.camera} cannot be drawn: {error}")
        finally:
            renderer.close()

    def _watch(self, physics: Physics) -> None:
        """Capture a frame at its exact simulated time, or as soon as the previous one is drawn.

        Frames are due at whole multiples of their period, so that cameras of one rate, and a demonstrator
        of that rate, have the same moments.
        """
        now_s = physics.time_s
        if now_s < self._last_time_s:
            self._due_at = self._due_from(now_s)
        self._last_time_s = now_s
        if (following := self._due_from(now_s, after=True)) > self._due_at:
            self._frame += following - self._due_at
            self._due_at = following
            self._late = True
        if self._late and not self._drawing and self._renderer is not None:
            self._late, self._drawing = False, True
            self._renderer.look(physics.data)
            self._taken = (self._stamps.now_ns(), self._frame)
            self._due.set()

    def _due_from(self, time_s: float, *, after: bool = False) -> int:
        """Return the number of the first frame at a time or later, or after it, in periods from time 0."""
        periods = time_s * self.settings.fps
        return math.floor(periods + 1e-6) + 1 if after else math.ceil(periods - 1e-6)

    def _camera_info(self, reading: Reading, frame_id: str) -> Any:
        assert self._world is not None
        width, height = self.settings.width, self.settings.height
        field_rad = field_of_view_rad(self._world.physics.model, self.settings.camera)
        focal = height / 2 / np.tan(field_rad / 2)
        camera = np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]], np.float64)
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

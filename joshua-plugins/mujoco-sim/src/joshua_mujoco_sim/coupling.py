"""Coupling of emulated devices to the physics (``--emulate --sim``) over a UNIX socket.

A bus registers with a JSON packet that names its actuators; the reply holds the middle of each joint's range
in radians. It then sends the servos' commands (for each joint target in radians, torque as fraction of stall,
speed in rad/s; torque 0 for a servo that is off) and receives the joint states (position in radians, speed in
rad/s, load as fraction of stall).

A camera registers with name, width and height; the reply repeats the size. Each further packet requests a
picture, which is sent as rows of RGB bytes in packets of at most ``PICTURE_PACKET_SIZE`` bytes, also while
the simulation is paused, as from a real camera.
"""

from __future__ import annotations

import contextlib
import json
import logging
import socket
import threading
from pathlib import Path
from typing import Any

import numpy as np

from joshua_mujoco_sim.actuator_group import ActuatorGroup
from joshua_mujoco_sim.model_file import ModelError
from joshua_mujoco_sim.opengl import RenderingError
from joshua_mujoco_sim.physics import FloatArray, Physics
from joshua_mujoco_sim.rendering import CameraRenderer
from joshua_mujoco_sim.world import World

#: Longest packet: 64 joints with three numbers each.
PACKET_SIZE = 64 * 3 * 8

#: Part of a picture that fits in one packet on every system.
PICTURE_PACKET_SIZE = 32_768

#: Largest side of a requested picture in pixels.
MAX_SIDE = 4096

#: Longest wait for the end of a drawing thread.
JOIN_S = 2.0


class CouplingServer:
    """Serves emulated buses and cameras while the world exists.

    Args:
        world: the physics; path: of the socket; log: for devices that cannot join.

    Raises:
        OSError: the socket cannot be made.
    """

    def __init__(self, world: World, path: Path, log: logging.Logger) -> None:
        self._world = world
        self._log = log
        self._path = path
        self._closed = False
        self._connections: list[socket.socket] = []
        self._threads: list[threading.Thread] = []
        self._opening = threading.Lock()
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        path.unlink(missing_ok=True)  # left by a killed process
        self._listener.bind(str(path))
        self._listener.listen()
        threading.Thread(target=self._accept, name="coupling", daemon=True).start()

    def close(self) -> None:
        """End all connections. Idempotent."""
        self._closed = True
        for link in (self._listener, *self._connections):
            with contextlib.suppress(OSError):
                link.shutdown(socket.SHUT_RDWR)
            link.close()
        for thread in self._threads:  # each thread frees its own OpenGL context
            thread.join(JOIN_S)
        with contextlib.suppress(OSError):  # a file system that has become read-only
            self._path.unlink(missing_ok=True)

    def _accept(self) -> None:
        while not self._closed:
            try:
                link, _ = self._listener.accept()
            except OSError:
                return  # closed
            thread = threading.Thread(target=self._serve, args=(link,), name="coupled", daemon=True)
            self._connections.append(link)
            self._threads.append(thread)
            thread.start()

    def _serve(self, link: socket.socket) -> None:
        with link, contextlib.suppress(OSError):
            kind = "device"
            try:
                hello = json.loads(link.recv(PACKET_SIZE))
                kind = "camera" if "camera" in hello else "bus"
                joined = self._renderer(hello) if kind == "camera" else self._drives(hello)
            except (ValueError, KeyError, TypeError, ModelError, RenderingError) as error:
                self._log.error("an emulated %s cannot join the simulation: %s", kind, error)
                link.send(json.dumps({"error": str(error)}).encode())
                return
            if isinstance(joined, ServoDrives):
                self._serve_bus(link, joined)
            else:
                self._serve_camera(link, joined)

    def _drives(self, hello: dict[str, Any]) -> ServoDrives:
        with self._world.lock:
            return ServoDrives(self._world.physics, hello["actuators"])

    def _serve_bus(self, link: socket.socket, drives: ServoDrives) -> None:
        link.send(json.dumps({"middle_rad": drives.middle_rad.tolist()}).encode())
        remove = self._world.before_step(drives.drive)
        try:
            while packet := link.recv(PACKET_SIZE):
                with self._world.lock:
                    drives.want(np.frombuffer(packet, np.float64))
                    state = drives.state()
                link.send(state)
        except ValueError as error:
            self._log.error("an emulated bus sent invalid data: %s", error)
        finally:
            remove()

    def _renderer(self, hello: dict[str, Any]) -> CameraRenderer:
        """Start OpenGL for a camera, on the thread that draws."""
        width, height = int(hello["width"]), int(hello["height"])
        if not (0 < width <= MAX_SIDE and 0 < height <= MAX_SIDE):
            raise ValueError(f"{width} × {height} is no size of a picture; allowed: up to {MAX_SIDE} a side")
        model = self._world.physics.model
        with self._opening:  # each enlarges the model's buffers; time continues
            return CameraRenderer(model, hello["camera"], width, height, shadows=self._world.settings.shadows)

    def _serve_camera(self, link: socket.socket, renderer: CameraRenderer) -> None:
        try:
            height, width, _ = renderer.shape
            link.send(json.dumps({"width": width, "height": height}).encode())
            while link.recv(PACKET_SIZE):
                with self._world.lock:
                    renderer.look(self._world.physics.data)
                picture = renderer.draw().tobytes()
                for start in range(0, len(picture), PICTURE_PACKET_SIZE):
                    link.send(picture[start : start + PICTURE_PACKET_SIZE])
        finally:
            renderer.close()


class ServoDrives:
    """Position servos of an emulated bus, driving actuators of the model with profile and torque limit.

    Args:
        physics: the model; actuators: in joint order.

    Raises:
        ModelError: the model has no such actuator.
    """

    def __init__(self, physics: Physics, actuators: list[str]) -> None:
        self._group: ActuatorGroup = physics.group(tuple(actuators))
        self._stall = self._group.stall_force  # the servo's own torque limit replaces the model's
        self._target = self._group.position_rad
        self._set_point = self._target.copy()
        self._torque = np.zeros(len(actuators))
        self._speed = np.zeros(len(actuators))
        self.middle_rad = self._group.middle_rad

    def want(self, values: FloatArray) -> None:
        """Set the servos' commands. Raises ValueError for a wrong number of values or a non-finite one."""
        if values.shape != (3 * len(self._group),) or not np.isfinite(values).all():
            raise ValueError(f"{values.size} values for {len(self._group)} joints, or one that is not finite")
        self._target, self._torque, self._speed = values.reshape(-1, 3).T.copy()

    def state(self) -> bytes:
        """Return the packed joint states."""
        group = self._group
        load = group.torque / np.where(self._stall > 0, self._stall, 1.0)
        return np.column_stack([group.position_rad, group.velocity_rad_s, load]).tobytes()

    def drive(self, physics: Physics) -> None:
        """Move the set-points (before each step, under the lock)."""
        position = self._group.position_rad
        on = self._torque > 0
        way = self._speed * physics.timestep_s
        step = np.clip(self._target - self._set_point, -way, way)
        self._set_point = np.where(on, self._set_point + step, position)
        self._group.set_command(self._set_point)
        limit = self._stall * np.clip(self._torque, 0.0, 1.0)  # 0 with torque off: the joint falls
        self._group.set_force_limit(limit)

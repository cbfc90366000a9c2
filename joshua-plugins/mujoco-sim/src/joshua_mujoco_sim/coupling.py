"""Emulated servo buses whose joints this physics moves (``--emulate --sim``), over a UNIX socket.

A bus introduces itself by a JSON packet with its actuators; the answer holds the middle of each joint's range
in radians. From then on it sends what its servos want (target in radians, torque as fraction of stall, speed
in rad/s for each joint, torque 0 for a servo that is off), and each time gets what its joints do (position in
radians, speed in rad/s, load as fraction of stall).
"""

from __future__ import annotations

import contextlib
import json
import logging
import socket
import threading
from pathlib import Path

import numpy as np

from joshua_mujoco_sim.model_file import ModelError
from joshua_mujoco_sim.physics import ActuatorGroup, FloatArray, Physics
from joshua_mujoco_sim.world import World

#: Longest packet: 64 joints, three numbers each.
PACKET_SIZE = 64 * 3 * 8


class BusServer:
    """Answers emulated buses for as long as the world lives.

    Args:
        world: the physics; path: of the socket; log: for what buses come and go.

    Raises:
        OSError: the socket cannot be made.
    """

    def __init__(self, world: World, path: Path, log: logging.Logger) -> None:
        self._world = world
        self._log = log
        self._path = path
        self._closed = False
        self._connections: list[socket.socket] = []
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        path.unlink(missing_ok=True)  # of a process that was killed
        self._listener.bind(str(path))
        self._listener.listen()
        threading.Thread(target=self._accept, name="buses", daemon=True).start()

    def close(self) -> None:
        """Ends all connections; a second call does nothing."""
        self._closed = True
        for link in (self._listener, *self._connections):
            with contextlib.suppress(OSError):
                link.shutdown(socket.SHUT_RDWR)
            link.close()
        self._path.unlink(missing_ok=True)

    def _accept(self) -> None:
        while not self._closed:
            try:
                link, _ = self._listener.accept()
            except OSError:
                return  # closed
            self._connections.append(link)
            threading.Thread(target=self._serve, args=(link,), name="bus", daemon=True).start()

    def _serve(self, link: socket.socket) -> None:
        with link, contextlib.suppress(OSError):
            try:
                hello = json.loads(link.recv(PACKET_SIZE))
                with self._world.lock:
                    drives = ServoDrives(self._world.physics, hello["actuators"])
            except (ValueError, KeyError, TypeError, ModelError) as error:
                self._log.error("an emulated bus cannot join the simulation: %s", error)
                link.send(json.dumps({"error": str(error)}).encode())
                return
            link.send(json.dumps({"middle_rad": drives.middle_rad.tolist()}).encode())
            remove = self._world.before_step(drives.drive)
            try:
                while packet := link.recv(PACKET_SIZE):
                    with self._world.lock:
                        drives.want(np.frombuffer(packet, np.float64))
                        state = drives.state()
                    link.send(state)
            except ValueError as error:
                self._log.error("an emulated bus sent nonsense: %s", error)
            finally:
                remove()


class ServoDrives:
    """Position servos of an emulated bus on actuators of the model: profile, torque limit, release.

    Args:
        physics: the model; actuators: in joint order.

    Raises:
        ModelError: the model has no such actuator.
    """

    def __init__(self, physics: Physics, actuators: list[str]) -> None:
        self._group: ActuatorGroup = physics.group(tuple(actuators))
        self._model = physics.model
        self._ids = [physics.model.actuator(name).id for name in actuators]
        self._force = physics.model.actuator_forcerange[self._ids].copy()
        self._stall = np.abs(self._force).max(axis=1)
        self._target = self._group.position_rad
        self._set_point = self._target.copy()
        self._torque = np.zeros(len(actuators))
        self._speed = np.zeros(len(actuators))
        self.middle_rad = self._group.middle_rad

    def want(self, values: FloatArray) -> None:
        """Takes what the servos want. Raises ValueError for another number of values or one not finite."""
        if values.shape != (3 * len(self._ids),) or not np.isfinite(values).all():
            raise ValueError(f"{values.size} values for {len(self._ids)} joints, or one that is not finite")
        self._target, self._torque, self._speed = values.reshape(-1, 3).T.copy()

    def state(self) -> bytes:
        """What the joints do, packed."""
        group = self._group
        load = group.torque / np.where(self._stall > 0, self._stall, 1.0)
        return np.column_stack([group.position_rad, group.velocity_rad_s, load]).tobytes()

    def drive(self, physics: Physics) -> None:
        """Moves the set-points, before each step and under the lock."""
        position = self._group.position_rad
        on = self._torque > 0
        way = self._speed * physics.timestep_s
        step = np.clip(self._target - self._set_point, -way, way)
        # a servo without torque only brakes, so that its joint sinks and can be pushed
        self._set_point = np.where(on, self._set_point + step, position)
        self._group.set_command(self._set_point)
        limit = np.where(on, np.clip(self._torque, 0.0, 1.0), 1.0)
        self._model.actuator_forcerange[self._ids] = self._force * limit[:, None]

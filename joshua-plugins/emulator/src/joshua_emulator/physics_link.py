"""Joints moved by a simulation: the servos send their commands, the physics returns the joint states.

``joshua_mujoco_sim.coupling`` describes the packets; any simulator may implement them.
"""

from __future__ import annotations

import contextlib
import json
import math
import socket
import struct
from collections.abc import Sequence
from pathlib import Path

from joshua_emulator.arms import TICKS_PER_RADIAN
from joshua_emulator.joint import Drive, Joint

#: Exchange period between servos and physics.
PERIOD_S = 0.002


class CoupledJoint(Joint):
    """A joint moved by a simulation; drive, temperature and stops stay those of the servo.

    Args:
        middle: shaft angle in ticks at the middle of the range; low, high: its stops.
        start_rad: initial position about the middle.

    Attributes:
        wanted: command of the servo to its motor.
    """

    def __init__(self, middle: float, low: float, high: float, start_rad: float = 0.0) -> None:
        super().__init__(middle + start_rad * TICKS_PER_RADIAN, low, high)
        self.middle = middle
        self.wanted = Drive()

    def advance(self, now_s: float, drive: Drive) -> None:
        """Store the servo's command and update the heat; move only with a hand."""
        self.wanted = drive
        last_s = now_s if self._time_s is None else self._time_s
        if now_s > last_s:
            self._heat(now_s - last_s)
            if drive.mode == "off" and self.hand is not None:  # as in a calibration, without physics
                self._follow_hand(now_s, now_s - last_s)
        self._time_s = max(now_s, last_s)


class PhysicsLink:
    """The connection of one bus to the physics; made as soon as the simulation runs.

    Args:
        path: of the simulation's socket; actuators: of its model, in cable order.
        joints: of the servos, in the same order.
    """

    def __init__(self, path: Path, actuators: Sequence[str], joints: Sequence[CoupledJoint]) -> None:
        self._path = path
        self._actuators = list(actuators)
        self._joints = list(joints)
        self._middle_rad = [0.0] * len(self._joints)
        self._link: socket.socket | None = None
        self._joined = False
        self._format = struct.Struct(f"{3 * len(self._joints)}d")

    def exchange(self) -> None:
        """Send the servos' commands and receive the joint states; connect if possible."""
        if self._link is None:
            self._connect()
        elif not self._joined:
            self._join(self._link)
        else:
            self._talk(self._link)

    def _talk(self, link: socket.socket) -> None:
        try:
            while packet := link.recv(self._format.size):
                self._take(packet)
        except BlockingIOError:
            with contextlib.suppress(BlockingIOError):
                self._say(link)
        except OSError:
            self._close()
        else:
            self._close()  # the simulation has gone

    def _close(self) -> None:
        """End the connection; the joints stay where they are."""
        link, self._link = self._link, None
        self._joined = False
        if link is not None:
            link.close()
        for joint in self._joints:
            joint.velocity = joint.load = 0.0

    def _connect(self) -> None:
        if not self._path.exists():
            return
        link = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        link.setblocking(False)
        try:
            link.connect(str(self._path))
            link.send(json.dumps({"actuators": self._actuators}).encode())
        except OSError:
            link.close()  # the simulation is about to start or to end; the next turn tries again
            return
        self._link = link

    def _join(self, link: socket.socket) -> None:
        """Process the reply to the registration; the bus continues until it arrives."""
        try:
            answer = json.loads(link.recv(4096))
            self._middle_rad = [float(value) for value in answer["middle_rad"]]
            self._joined = True
            self._say(link)
        except BlockingIOError:
            return
        except (OSError, ValueError, KeyError):
            self._close()

    def _say(self, link: socket.socket) -> None:
        values: list[float] = []
        for joint, middle_rad in zip(self._joints, self._middle_rad, strict=True):
            drive = joint.wanted
            target = drive.target if drive.mode == "position" else joint.angle
            on = drive.mode != "off" and not joint.blocked
            values += (
                middle_rad + (target - joint.middle) / TICKS_PER_RADIAN,
                drive.torque_limit if on else 0.0,
                drive.speed_limit / TICKS_PER_RADIAN,
            )
        if all(map(math.isfinite, values)):
            link.send(self._format.pack(*values))

    def _take(self, packet: bytes) -> None:
        values = self._format.unpack(packet)
        for index, (joint, middle_rad) in enumerate(zip(self._joints, self._middle_rad, strict=True)):
            position_rad, velocity_rad_s, load = values[3 * index : 3 * index + 3]
            joint.angle = joint.middle + (position_rad - middle_rad) * TICKS_PER_RADIAN
            joint.velocity = velocity_rad_s * TICKS_PER_RADIAN
            joint.load = load

"""Switching the torque of all joints on and off, verified by reading it back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from joshua.devices.errors import DeviceError
from joshua.devices.servo.errors import NoReply

from joshua_sts3215.bus import Bus
from joshua_sts3215.registers import (
    ACCELERATION,
    GOAL_POSITION,
    GOAL_SPEED,
    GOAL_TIME,
    TORQUE_ENABLE,
    TORQUE_OFF,
    TORQUE_ON,
)

ATTEMPTS = 3

_ON = TORQUE_ENABLE.encode(TORQUE_ON)
_OFF = TORQUE_ENABLE.encode(TORQUE_OFF)
_MOVE_START = ACCELERATION.address
_MOVE_WIDTH = GOAL_SPEED.address + GOAL_SPEED.width - _MOVE_START


class TorqueSwitch:
    """The torque of one arm.

    Args:
        names: joint names by servo id, in joint order.
    """

    def __init__(self, bus: Bus, names: Mapping[int, str]) -> None:
        self._bus = bus
        self._names = names
        self._ids = tuple(names)
        self._moves = b""  # acceleration and speed as last written, "" without torque

    def switch_on(self, goals_ticks: Sequence[int], acceleration: int, speed_ticks_s: int) -> None:
        """Seeds goal, speed and acceleration in one packet, switches torque on, and verifies all of it.

        Args:
            goals_ticks: where the joints are now, in joint order.
            acceleration, speed_ticks_s: of moves from now on, as the registers take them.

        Raises:
            DeviceError: a servo did not take it; then all joints were released.
        """
        rows = {
            servo_id: (
                ACCELERATION.encode(acceleration)
                + GOAL_POSITION.encode(ticks)
                + GOAL_TIME.encode(0)
                + GOAL_SPEED.encode(speed_ticks_s)
            )
            for servo_id, ticks in zip(self._ids, goals_ticks, strict=True)
        }
        self._moves = ACCELERATION.encode(acceleration) + GOAL_SPEED.encode(speed_ticks_s)
        for _ in range(ATTEMPTS):
            self._bus.sync_write(_MOVE_START, _MOVE_WIDTH, rows)
            self._bus.sync_write(TORQUE_ENABLE.address, TORQUE_ENABLE.width, dict.fromkeys(rows, _ON))
            found = self._bus.sync_read(TORQUE_ENABLE.address, TORQUE_ENABLE.width + _MOVE_WIDTH, self._ids)
            rows = {servo_id: row for servo_id, row in rows.items() if found.get(servo_id) != _ON + row}
            if not rows:
                return
        self.switch_off()
        raise DeviceError(
            f"{self._bus.port}: {self._list(rows)} did not take goal and torque in {ATTEMPTS} attempts; "
            "all joints were released. Check the supply voltage and run joshua doctor."
        )

    def switch_off(self) -> None:
        """Takes torque off all joints. Raises NoReply where one does not confirm it, and PortDisconnected."""
        self._moves = b""
        waiting = self._ids
        for _ in range(ATTEMPTS):
            self._bus.sync_write(TORQUE_ENABLE.address, TORQUE_ENABLE.width, dict.fromkeys(self._ids, _OFF))
            found = self._bus.sync_read(TORQUE_ENABLE.address, TORQUE_ENABLE.width, waiting)
            waiting = tuple(servo_id for servo_id in waiting if found.get(servo_id) != _OFF)
            if not waiting:
                return
        raise NoReply(
            f"{self._bus.port}: {self._list(waiting)} does not confirm that its torque is off. "
            "Cut the arm's supply by hand if it holds."
        )

    def lapsed(self) -> str:
        """Names joints that lost torque or speed settings by themselves, as a power cut does; "" for none.

        Servos that do not answer are not judged. Raises PortDisconnected.
        """
        lapsed = []
        width = TORQUE_ENABLE.width + _MOVE_WIDTH
        for servo_id, block in self._bus.sync_read(TORQUE_ENABLE.address, width, self._ids).items():
            moves = block[1:2] + block[-GOAL_SPEED.width :]
            if block[:1] != _ON or moves != self._moves:
                lapsed.append(servo_id)
        return self._list(lapsed)

    def _list(self, ids: Sequence[int] | Mapping[int, bytes]) -> str:
        return ", ".join(f"{self._names[servo_id]} (id {servo_id})" for servo_id in ids)

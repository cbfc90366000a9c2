"""Switching the torque of all joints on and off, verified by reading it back."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from joshua.api import DeviceError
from joshua.api.patience import Patience

from joshua_servo.bus import ServoBus
from joshua_servo.errors import NoReply
from joshua_servo.family import ServoFamily
from joshua_servo.register import Register
from joshua_servo.register_read import read_registers

ATTEMPTS = 3  # of a write without a reply, which may be lost
ROUND_S = 0.06  # for reading back the torque, before it is switched off again
LAPSE_S = 0.0  # no retries, because this check between control cycles is repeated anyway

#: Register values of a move without the goal.
MoveValues = Mapping[Register, int]


class TorqueSwitch:
    """The torque of one arm.

    Args:
        names: joint names by servo id, in joint order.
    """

    def __init__(self, bus: ServoBus, family: ServoFamily, names: Mapping[int, str]) -> None:
        self._bus = bus
        self._family = family
        self._names = names
        self._ids = tuple(names)
        self._start = family.moves[0].address
        self._on = family.torque_enable.encode(1)
        self._off = family.torque_enable.encode(0)
        self._kept: dict[int, dict[Register, bytes]] = {}  # by servo id, as last written with torque

    def switch_on(
        self, goals_ticks: Sequence[int], values: Sequence[MoveValues], only: Collection[int] | None = None
    ) -> None:
        """Write goal, speed and acceleration in one packet, enable torque, and verify everything.

        Args:
            goals_ticks: present positions, in joint order.
            values: values of the other registers of a move, in joint order.
            only: ids of the servos that get torque; None for all.

        Raises:
            DeviceError: a servo did not accept it. Then the torque of all these joints is off.
        """
        family, torque = self._family, self._family.torque_enable
        rows = {}
        for servo_id, ticks, row in zip(self._ids, goals_ticks, values, strict=True):
            if only is not None and servo_id not in only:
                continue
            move = {**row, family.goal_position: ticks}
            rows[servo_id] = b"".join(register.encode(move[register]) for register in family.moves)
            self._kept[servo_id] = {register: register.encode(move[register]) for register in family.kept}
        for _ in range(ATTEMPTS):
            self._bus.sync_write(self._start, family.moves_width, rows)
            self._bus.sync_write(torque.address, torque.width, dict.fromkeys(rows, self._on))
            found = self._states()
            rows = {
                servo_id: row
                for servo_id, row in rows.items()
                if not self._has_taken(found.get(servo_id), row)
            }
            if not rows:
                return
            if any(servo_id not in found for servo_id in rows):
                break  # silent: the patience with it has ended
        self.switch_off(only)
        raise DeviceError(
            f"{self._bus.port}: {self._list(rows)} did not take goal and torque. "
            f"The torque of {'all joints' if only is None else 'this joint'} is off. Check the supply "
            "voltage and run `joshua doctor`."
        )

    def switch_off(self, only: Collection[int] | None = None) -> None:
        """Disable the torque of all or some joints. Raises NoReply and PortDisconnected."""
        ids = tuple(servo_id for servo_id in self._ids if only is None or servo_id in only)
        self._kept = {servo_id: row for servo_id, row in self._kept.items() if servo_id not in ids}
        torque = self._family.torque_enable
        waiting = ids
        patience = Patience(self._bus.patience_s, period_s=self._bus.reply_margin_s)
        while True:
            patience.begin()
            self._bus.sync_write(torque.address, torque.width, dict.fromkeys(ids, self._off))
            found = self._bus.sync_read(torque.address, torque.width, waiting, within_s=ROUND_S)
            waiting = tuple(servo_id for servo_id in waiting if found.get(servo_id) != self._off)
            if not waiting:
                return
            if not patience.miss():
                break
        raise NoReply(
            f"{self._bus.port}: {self._list(waiting)} does not confirm that its torque is off. Cut the "
            "arm's supply by hand if it still holds."
        )

    def read(self) -> dict[str, bool]:
        """Whether each joint has torque, by name. Raises NoReply and PortDisconnected."""
        torque = self._family.torque_enable
        found = self._bus.sync_read(torque.address, torque.width, self._ids)
        if silent := [servo_id for servo_id in self._ids if servo_id not in found]:
            raise self._bus.no_reply(
                f"{self._list(silent)} does not report its torque", "Check cable and supply."
            )
        return {self._names[i]: torque.decode(found[i]) != 0 for i in self._ids}

    def lapsed(self) -> str:
        """Name joints that lost torque or speed settings by themselves, as by a power cut; "" for none.

        Ignores servos that do not reply. Raises PortDisconnected.
        """
        lapsed = []
        for servo_id, found in self._states(within_s=LAPSE_S).items():
            kept = self._kept.get(servo_id)
            if kept is None:
                continue  # its torque was disabled on purpose
            has_torque = found[self._family.torque_enable] == self._on
            if not has_torque or {register: found[register] for register in kept} != kept:
                lapsed.append(servo_id)
        return self._list(lapsed)

    def _states(self, within_s: float | None = None) -> dict[int, dict[Register, bytes]]:
        """Torque and the registers of a move."""
        registers = (self._family.torque_enable, *self._family.moves)
        return read_registers(self._bus, self._family, registers, self._ids, within_s=within_s)

    def _has_taken(self, found: Mapping[Register, bytes] | None, row: bytes) -> bool:
        if found is None or found[self._family.torque_enable] != self._on:
            return False
        return b"".join(found[register] for register in self._family.moves) == row

    def _list(self, ids: Sequence[int] | Mapping[int, bytes]) -> str:
        return ", ".join(f"{self._names[servo_id]} (id {servo_id})" for servo_id in ids)

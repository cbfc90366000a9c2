"""Settings of single servos in their registers: written, read back, and restored."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from joshua.api import DeviceError

from joshua_servo.bus import ServoBus
from joshua_servo.family import ServoFamily
from joshua_servo.register import Register
from joshua_servo.register_read import read_registers

#: Address, width and value of a register of the EEPROM.
StoredRegister = tuple[int, int, int]


class Tuning:
    """The settings of one arm's servos.

    Args:
        values: register values of the settings, by servo id.
    """

    def __init__(
        self, bus: ServoBus, family: ServoFamily, values: Mapping[int, Mapping[Register, int]]
    ) -> None:
        self._bus = bus
        self._family = family
        self._values = values
        self._before: dict[int, dict[Register, int]] = {}  # original values of the EEPROM

    @property
    def before(self) -> dict[int, list[StoredRegister]]:
        """Original values of the changed EEPROM registers, by servo id."""
        return {
            servo_id: [(register.address, register.width, value) for register, value in row.items()]
            for servo_id, row in self._before.items()
        }

    def apply(self) -> None:
        """Write changed values and read them back. Raises NoReply, ServoRefused and PortDisconnected."""
        registers = {register for row in self._values.values() for register in row}
        if not registers:
            return
        found = read_registers(self._bus, self._family, registers, tuple(self._values))
        if silent := [servo_id for servo_id in self._values if servo_id not in found]:
            listed = ", ".join(map(str, silent))
            raise self._bus.no_reply(
                f"ids {listed} do not answer a read of their settings", "Check cable and supply."
            )
        for servo_id, row in self._values.items():
            held = {register: register.decode(found[servo_id][register]) for register in row}
            changed = {register: value for register, value in row.items() if held[register] != value}
            eeprom = {register: value for register, value in changed.items() if register.eeprom}
            if eeprom:
                before = self._before.setdefault(servo_id, {})
                for register in eeprom:
                    before.setdefault(register, held[register])
                self._bus.write_eeprom(servo_id, eeprom)
            self._bus.write_checked(servo_id, {r: v for r, v in changed.items() if not r.eeprom})

    def restore(self) -> None:
        """Restore the EEPROM. Raises NoReply, ServoRefused and PortDisconnected."""
        restore(self._bus, self.before)
        self._before = {}


def restore(bus: ServoBus, before: Mapping[int, Iterable[StoredRegister]]) -> None:
    """Restore registers of the EEPROM. Tries every servo before raising the first error.

    Raises NoReply, ServoRefused and PortDisconnected.
    """
    failed: DeviceError | None = None
    for servo_id, row in before.items():
        registers = {Register(f"register {at}", at, width, eeprom=True): value for at, width, value in row}
        try:
            bus.write_eeprom(servo_id, registers)
        except DeviceError as error:
            failed = failed or error
    if failed is not None:
        raise failed

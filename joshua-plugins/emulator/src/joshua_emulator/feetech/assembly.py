"""Assembly of an emulated Feetech bus from its description."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from joshua_emulator.faults import Faults
from joshua_emulator.feetech.bus import FeetechBus
from joshua_emulator.feetech.registers import BAUDRATES
from joshua_emulator.feetech.servo import MIDDLE, Servo
from joshua_emulator.joint import Joint
from joshua_emulator.servo_bus.assembly import BusAssembly, BusSpec
from joshua_emulator.servo_bus.servo import Supply


class FeetechAssembly(BusAssembly[Servo]):
    """An emulated Feetech bus; models are named by their number."""

    def __init__(self, spec: BusSpec) -> None:
        self._supply = Supply() if spec.volts is None else Supply(spec.volts)
        super().__init__(spec)

    def make_bus(self, servos: Sequence[Servo], faults: Faults) -> FeetechBus:
        """Make the bus of the family's protocol."""
        return FeetechBus(servos, self.log, faults, echo=self.spec.echo)

    def make_servo(
        self,
        slot: int,
        joint: Joint,
        stored: bytes | None = None,
        on_eeprom: Callable[[bytes], None] = lambda _: None,
    ) -> Servo:
        """Make one servo."""
        servo = Servo(joint, self._supply, stored, on_eeprom=on_eeprom, on_torque=self.note_torque)
        if slot < len(self.spec.models):
            servo.put("model_number", int(self.spec.models[slot]))
        return servo

    def set_up(self, servo: Servo, servo_id: int, middle: int, half: float) -> bytes:
        """Configure a factory-new servo with its id and the spec. Return its EEPROM."""
        servo.put("id", servo_id)
        servo.put("baudrate", next(code for code, rate in BAUDRATES.items() if rate == self.spec.baudrate))
        servo.put("return_delay", min(254, round(self.spec.return_delay_s / 2e-6)))
        if self.spec.calibrated:
            servo.put("homing_offset", middle - MIDDLE)
            servo.put("min_position_limit", max(0, round(MIDDLE - half)))
            servo.put("max_position_limit", min(4095, round(MIDDLE + half)))
        servo.power_on()
        return servo.eeprom

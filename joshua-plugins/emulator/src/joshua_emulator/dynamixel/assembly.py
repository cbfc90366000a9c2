"""Assembly of an emulated Dynamixel bus from its description."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from joshua_emulator.dynamixel.bus import DynamixelBus
from joshua_emulator.dynamixel.models import MODELS, Model
from joshua_emulator.dynamixel.registers import BAUDRATES, OperatingMode
from joshua_emulator.dynamixel.servo import Servo
from joshua_emulator.faults import Faults
from joshua_emulator.joint import Joint
from joshua_emulator.motion import MIDDLE
from joshua_emulator.servo_bus.assembly import BusAssembly, SpecError
from joshua_emulator.servo_bus.servo import Supply

USUAL_MODEL = "xl330-m077"


class DynamixelAssembly(BusAssembly[Servo]):
    """An emulated Dynamixel bus; models by name, the last one for all that follow."""

    def make_bus(self, servos: Sequence[Servo], faults: Faults) -> DynamixelBus:
        """Make the bus of the family's protocol."""
        return DynamixelBus(servos, self.log, faults, echo=self.spec.echo)

    def make_servo(
        self,
        slot: int,
        joint: Joint,
        stored: bytes | None = None,
        on_eeprom: Callable[[bytes], None] = lambda _: None,
    ) -> Servo:
        """Make one servo."""
        model = self._model(slot)
        supply = Supply(model.volts if self.spec.volts is None else self.spec.volts)
        return Servo(model, joint, supply, stored, on_eeprom=on_eeprom, on_torque=self.note_torque)

    def set_up(self, servo: Servo, servo_id: int, middle: int, half: float) -> bytes:
        """Configure a factory-new servo with its id and the spec. Return its EEPROM."""
        servo.put("id", servo_id)
        servo.put("baudrate", next(code for code, rate in BAUDRATES.items() if rate == self.spec.baudrate))
        servo.put("return_delay", min(254, round(self.spec.return_delay_s / 2e-6)))
        if self.spec.arm:  # horns are mounted at any angle, and only this mode accepts any homing offset
            servo.put("operating_mode", OperatingMode.EXTENDED_POSITION)
        if self.spec.calibrated:
            servo.put("homing_offset", MIDDLE - middle)
            servo.put("min_position_limit", max(0, round(MIDDLE - half)))
            servo.put("max_position_limit", min(4095, round(MIDDLE + half)))
        servo.power_on()
        return servo.eeprom

    def slot_key(self, slot: int) -> str:
        """Return slot and model: another model in the same slot has its own EEPROM."""
        return f"{slot} {self._model(slot).name}"

    def _model(self, slot: int) -> Model:
        names = self.spec.models or (USUAL_MODEL,)
        name = names[min(slot, len(names) - 1)]
        if name not in MODELS:
            raise SpecError(f"model {name!r} is not emulated; allowed: {', '.join(MODELS)}")
        return MODELS[name]

"""One servo of the X series: its control table, its protections and the joint that it moves."""

from __future__ import annotations

from typing import Any

from joshua_emulator.dynamixel.control import make_drive, written_registers
from joshua_emulator.dynamixel.models import Model
from joshua_emulator.dynamixel.packets import ALERT, ProtocolError
from joshua_emulator.dynamixel.registers import (
    BAUDRATES,
    BY_NAME,
    DEFINED,
    EEPROM_END,
    EEPROM_START,
    MEMORY_SIZE,
    TABLE,
    Hardware,
    OperatingMode,
)
from joshua_emulator.dynamixel.units import VELOCITY_TICKS_S
from joshua_emulator.joint import TICKS_PER_TURN, Joint
from joshua_emulator.servo_bus.registers import Area
from joshua_emulator.servo_bus.servo import EmulatedServo, OnEeprom, OnTorque, Supply

BOOT_TIME_S = 0.05  # a servo does not reply for this long after power-on
OVERLOAD_SHARE = 0.8  # of stall torque
OVERLOAD_TIME_S = 1.0
LARGEST_JOINT_OFFSET = 1024  # larger homing offsets are ignored in position mode
_FEEDBACK = (BY_NAME["hardware_error"].address, BY_NAME["realtime_tick"].address)


class Servo(EmulatedServo):
    """One servo of a bus.

    Args:
        joint: what it moves.
        supply: what feeds it.
        eeprom: contents of addresses 7 to 63; None means factory settings.
        on_eeprom: called with the new contents after each change.
        on_torque: called with (servo, energised, time in s) when torque turns on or off.
    """

    registers = BY_NAME
    state_names = (
        "present_position", "goal_position", "present_speed", "present_load", "present_voltage",
        "present_temperature", "torque_enable", "hardware_error", "homing_offset", "operating_mode",
    )  # fmt: skip
    id_address = 7
    baudrates = BAUDRATES
    eeprom_span = (EEPROM_START, EEPROM_END)

    def __init__(
        self,
        model: Model,
        joint: Joint,
        supply: Supply,
        eeprom: bytes | None = None,
        on_eeprom: OnEeprom = lambda _: None,
        on_torque: OnTorque = lambda *_: None,
    ) -> None:
        super().__init__(joint, supply, bytearray(MEMORY_SIZE), on_eeprom, on_torque)
        self.model = model
        self._latched = 0  # hardware errors that stay until a reboot
        self._overload_s = 0.0
        self._turn = 0  # shaft angle from which positions count
        self._take_factory_settings()  # without a report: keep the stored EEPROM
        if eeprom is not None:
            self.eeprom = eeprom
        self.power_on()

    @property
    def low_volts(self) -> float:
        """Supply voltage below which the servo reports undervoltage."""
        return self.get("min_voltage") / 10 - 1.0

    @property
    def status(self) -> int:
        """Bits of hardware_error."""
        return self.memory[70]

    @property
    def alert(self) -> int:
        """Alert bit of the error byte, set while there is a hardware error."""
        return ALERT if self.memory[70] else 0

    @property
    def direction(self) -> int:
        """-1 where the drive mode reverses the servo."""
        return -1 if self.memory[10] & 1 else 1

    def present(self) -> int:
        """Present position in ticks: the multi-turn encoder position plus the homing offset."""
        return self.direction * (round(self.joint.angle) - self._turn) + self._offset()

    def angle_at(self, position: float) -> float:
        """Return the shaft angle of a position in ticks."""
        return self.direction * (position - self._offset()) + self._turn

    def angle_of(self, position: float) -> float:
        """Return the nearest shaft angle that reads as a position in ticks."""
        return self.joint.angle + self.direction * (position - self.present())

    def read(self, address: int, length: int, now_s: float) -> tuple[ProtocolError, bytes]:
        """Read memory; a read that touches an address without a register is refused as a whole."""
        if not length or not DEFINED.issuperset(range(address, address + length)):
            return ProtocolError.ACCESS, b""
        if address + length > _FEEDBACK[0]:
            self.advance(now_s)
        return ProtocolError.NONE, bytes(self.memory[address : address + length])

    def write(self, address: int, data: bytes, now_s: float) -> ProtocolError:
        """Write registers like a host, all or none of them."""
        self.advance(now_s)
        error, written = written_registers(self, address, data)
        if error:
            return error
        eeprom = self.eeprom
        for register, value in written.items():
            self.put(register.name, value)
        self._react({register.name for register in written})
        changed = self.eeprom
        if changed != eeprom:
            self._on_eeprom(changed)
        self._update_drive(now_s)
        self._measure()
        return ProtocolError.NONE

    def power_on(self, now_s: float | None = None) -> None:
        """Restart as after a power cut or reboot: EEPROM stays, torque is off, the turn count is lost."""
        for register in TABLE:
            if register.area is Area.RAM:
                self.put(register.name, register.default)
        self.put("goal_current", self.get("current_limit"))
        self.pending = None
        self._latched = 0
        self._overload_s = 0.0
        self.silent_until_s = 0.0 if now_s is None else now_s + BOOT_TIME_S
        self.memory[70] = 0
        self._count_from_here()
        self._update_drive(now_s or 0.0)
        self._measure()

    def restore_factory_settings(self, *, keep: int = 0) -> None:
        """Restore factory settings in the EEPROM, except the first ``keep`` of id and baud rate."""
        kept = bytes(self.memory[EEPROM_START : EEPROM_START + keep])
        self._take_factory_settings()
        self.memory[EEPROM_START : EEPROM_START + keep] = kept
        self._on_eeprom(self.eeprom)

    def _take_factory_settings(self) -> None:
        for register in TABLE:
            self.put(register.name, self.model.defaults.get(register.name, register.default))
        self.put("model_number", self.model.number)

    def clear_turns(self, now_s: float) -> ProtocolError:
        """Reset the turn count; refused while torque is on."""
        if self._energised:
            return ProtocolError.RESULT_FAIL
        self.advance(now_s)
        self._count_from_here()
        self._measure()
        return ProtocolError.NONE

    def overload(self, now_s: float) -> None:
        """Trip the overload protection."""
        self.advance(now_s)
        self._latched |= Hardware.OVERLOAD
        self._shut_down()
        self._measure()

    def calibration(self) -> dict[str, Any]:
        """``homing_offset``, ``range_min`` and ``range_max`` as a calibration block has them."""
        return {
            "homing_offset": -self.get("homing_offset"),  # there it is subtracted
            "range_min": self.get("min_position_limit"),
            "range_max": self.get("max_position_limit"),
        }

    @property
    def shut_down(self) -> bool:
        """Whether a hardware error keeps the torque off until a reboot."""
        return bool(self.memory[70] & self.memory[63])

    def _offset(self) -> int:
        offset = self.get("homing_offset")
        if self.memory[11] == OperatingMode.POSITION and abs(offset) > LARGEST_JOINT_OFFSET:
            return 0
        return offset

    def _count_from_here(self) -> None:
        """Reset the turn count as after power-on, and set the goal to the present position."""
        self._turn = round(self.joint.angle) // TICKS_PER_TURN * TICKS_PER_TURN
        self.put("goal_position", self.present())

    def _react(self, written: set[str]) -> None:
        if "operating_mode" in written:
            self._count_from_here()
            self.put("profile_velocity", 0)
            self.put("profile_acceleration", 0)
        if "goal_position" in written and self.memory[10] & 8 and not self.shut_down:
            self.put("torque_enable", 1)  # drive mode "torque on by goal update"
        if "torque_enable" in written and self.memory[64] and self.memory[11] == OperatingMode.POSITION:
            goal = self.get("goal_position")
            self._count_from_here()
            self.put("goal_position", goal)

    def _protect(self, elapsed_s: float) -> None:
        if self.joint.temperature_c > self.get("max_temperature"):
            self._latched |= Hardware.TEMPERATURE
        if self._energised and abs(self.joint.load) >= OVERLOAD_SHARE:
            self._overload_s += elapsed_s
            if self._overload_s >= OVERLOAD_TIME_S:
                self._latched |= Hardware.OVERLOAD
        else:
            self._overload_s = 0.0
        self._shut_down()

    def _shut_down(self) -> None:
        volts = self._volts() * 10
        out_of_range = not self.get("min_voltage") <= volts <= self.get("max_voltage")
        errors = self._latched | (Hardware.VOLTAGE if out_of_range else 0)
        self.memory[70] = errors
        if errors & self.memory[63]:
            self._latched |= errors
            self.put("torque_enable", 0)
            self._update_drive(self._time_s or 0.0)

    def _volts(self) -> float:
        return self.supply.volts * (1.0 - 0.0125 * abs(self.joint.load))

    def _measure(self) -> None:
        joint, model = self.joint, self.model
        amperes = joint.load * model.stall_a
        load = amperes / model.current_unit_a if model.current_unit_a else joint.load * 1000
        self.put("moving", int(joint.velocity != 0.0))
        self.put("realtime_tick", round((self._time_s or 0.0) * 1000) % 32768)
        self.put("present_load", max(-32767, min(32767, round(self.direction * load))))
        self.put("present_speed", round(self.direction * joint.velocity / VELOCITY_TICKS_S))
        self.put("present_position", self.present())
        self.put("position_trajectory", self.present())
        self.put("present_voltage", max(0, min(0xFFFF, round(self._volts() * 10))))
        self.put("present_temperature", max(0, min(255, round(joint.temperature_c))))
        self.put("pending_write", int(self.pending is not None))

    def _update_drive(self, now_s: float) -> None:
        self._set_drive(make_drive(self) if self.memory[64] else None, now_s)

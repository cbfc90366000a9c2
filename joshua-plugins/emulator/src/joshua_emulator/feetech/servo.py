"""One STS3215 servo: its memory, its protections and the joint that it moves."""

from __future__ import annotations

import struct
from collections.abc import Collection
from typing import Any

from joshua_emulator.feetech.registers import (
    BAUDRATES,
    BY_ADDRESS,
    BY_NAME,
    EEPROM_END,
    EEPROM_START,
    MEMORY_SIZE,
    Status,
    factory_memory,
)
from joshua_emulator.joint import TICKS_PER_TURN, Drive, Joint
from joshua_emulator.servo_bus.registers import Area, Register
from joshua_emulator.servo_bus.servo import EmulatedServo, OnEeprom, OnTorque, Supply

MIDDLE = 2048
CALIBRATE_MIDDLE = 128  # value of torque_enable
CURRENT_UNIT_A = 0.0065
BOOT_TIME_S = 0.05  # a servo does not reply for this long after power-on
PROTECTION_UNIT_S = 0.01

#: Load per tick of error and unit of the position gain. With the factory's gain of 32, 20 to 30 ticks of
#: error were measured under 35 % of the stall torque (robonine.com, 2025).
STIFFNESS = 1 / 2200

_FEEDBACK = struct.Struct("<HHHBBBBBHH")  # present_position to present_current
_FEEDBACK_START = BY_NAME["present_position"].address
_FEEDBACK_END = _FEEDBACK_START + _FEEDBACK.size
_MOVES_TARGET = {
    "goal_position",
    "torque_enable",
    "mode",
    "homing_offset",
    "min_position_limit",
    "max_position_limit",
}


class Servo(EmulatedServo):
    """One servo of a bus.

    Args:
        joint: what it moves.
        supply: what feeds it.
        eeprom: contents of addresses 5 to 39; None means factory settings.
        on_eeprom: called with the new contents after each change.
        on_torque: called with (servo, energised, time in s) when torque turns on or off.
    """

    registers = BY_NAME
    state_names = (
        "present_position", "goal_position", "present_speed", "present_load", "present_voltage",
        "present_temperature", "present_current", "torque_enable", "lock", "status", "homing_offset",
    )  # fmt: skip
    id_address = 5
    baudrates = BAUDRATES
    eeprom_span = (EEPROM_START, EEPROM_END)

    def __init__(
        self,
        joint: Joint,
        supply: Supply,
        eeprom: bytes | None = None,
        on_eeprom: OnEeprom = lambda _: None,
        on_torque: OnTorque = lambda *_: None,
    ) -> None:
        super().__init__(joint, supply, factory_memory(), on_eeprom, on_torque)
        self._faults = 0  # latched status bits
        self._overload_s = 0.0
        self._target = joint.angle  # shaft angle, or relative to it in the other modes
        if eeprom is not None:
            self.eeprom = eeprom
        self.power_on()

    @property
    def status(self) -> int:
        """Status bits as replies carry them."""
        return self.memory[65]

    @property
    def low_volts(self) -> float:
        """Supply voltage below which the servo reports undervoltage."""
        return self.get("min_voltage") / 10 - 0.5

    def present(self) -> int:
        """Present position in ticks, 0 to 4095, homing offset applied."""
        return (round(self.joint.angle) - self.get("homing_offset")) % TICKS_PER_TURN

    def read(self, address: int, length: int, now_s: float) -> bytes:
        """Read memory; bytes beyond the table are 0."""
        if address < _FEEDBACK_END and address + length > _FEEDBACK_START:
            self.advance(now_s)
        return bytes(self.memory[address : address + length]).ljust(length, b"\0")

    def write(self, address: int, data: bytes, now_s: float) -> None:
        """Write registers like a host; ignores read-only and locked ones and values out of range."""
        self.advance(now_s)
        end = min(address + len(data), MEMORY_SIZE)
        eeprom = self.eeprom
        written = []
        at = address
        while at < end:
            register = BY_ADDRESS.get(at)
            if register is None or at + register.width > end:
                at += 1
                continue
            raw = data[at - address : at - address + register.width]
            if self._writable(register, register.decode(int.from_bytes(raw, "little"))):
                self.memory[at : at + register.width] = raw
                written.append(register.name)
            at += register.width
        self._react(written, now_s)
        if not _MOVES_TARGET.isdisjoint(written):
            self._retarget(written)
        changed = self.eeprom
        if changed != eeprom:
            self._on_eeprom(changed)
        self._update_drive(now_s)

    def power_on(self, now_s: float | None = None) -> None:
        """Restart as after a power cut: EEPROM stays, everything else is at its default, torque is off.

        Args:
            now_s: when power returned; the servo does not reply for a short time afterwards.
        """
        for register in BY_NAME.values():
            if register.area is Area.RAM:
                self.put(register.name, register.default)
        self.put("torque_limit", self.get("max_torque"))
        self.pending = None
        self._faults = 0
        self._overload_s = 0.0
        self.silent_until_s = 0.0 if now_s is None else now_s + BOOT_TIME_S
        self.put("goal_position", self.present())
        self.put("status", 0)
        self._retarget(())
        self._update_drive(now_s or 0.0)
        self._measure()

    def restore(self, now_s: float) -> None:
        """Restore factory settings in the EEPROM, except the id."""
        servo_id = self.servo_id
        self.memory[EEPROM_START:EEPROM_END] = factory_memory()[EEPROM_START:EEPROM_END]
        self.memory[5] = servo_id
        self._on_eeprom(self.eeprom)
        self.power_on(now_s)

    def calibrate(self, position: int, now_s: float) -> None:
        """Set the homing offset so that the present position becomes ``position``; ignore the lock.

        The register holds ±2047 ticks; a larger offset is clipped.
        """
        self.advance(now_s)
        offset = (round(self.joint.angle) - position) % TICKS_PER_TURN
        if offset > TICKS_PER_TURN // 2:
            offset -= TICKS_PER_TURN
        self.put("homing_offset", max(-2047, min(2047, offset)))
        self.put("goal_position", self.present())
        self._retarget(())
        self._on_eeprom(self.eeprom)
        self._update_drive(now_s)

    def trip(self, bits: int, now_s: float) -> None:
        """Latch status bits like a protection."""
        self.advance(now_s)
        self._faults |= bits
        self._update_drive(now_s)
        self._measure()

    def overload(self, now_s: float) -> None:
        """Trip the overload protection."""
        self.trip(Status.OVERLOAD, now_s)

    def calibration(self) -> dict[str, Any]:
        """``homing_offset``, ``range_min`` and ``range_max`` as a calibration block has them."""
        return {
            "homing_offset": self.get("homing_offset"),
            "range_min": self.get("min_position_limit"),
            "range_max": self.get("max_position_limit"),
        }

    def _writable(self, register: Register, value: int) -> bool:
        if register.area is Area.EEPROM:
            return not self.get("lock") and register.minimum <= value <= register.maximum
        return register.area is Area.RAM and register.minimum <= value <= register.maximum

    def _react(self, written: list[str], now_s: float) -> None:
        if "torque_enable" in written:
            if self.get("torque_enable") == CALIBRATE_MIDDLE:
                self.put("torque_enable", 0)
                self.calibrate(MIDDLE, now_s)
            self._faults = 0
            self._overload_s = 0.0
        if "goal_position" in written and self.get("mode") in (0, 3):
            self.put("torque_enable", 1)  # as measured on hardware: a new goal enables torque

    def _protect(self, elapsed_s: float) -> None:
        if self.joint.temperature_c > self.get("max_temperature"):
            self._faults |= Status.TEMPERATURE
        if self._energised and abs(self.joint.load) * 100 >= self.get("overload_torque"):
            self._overload_s += elapsed_s
            if self._overload_s >= self.get("protection_time") * PROTECTION_UNIT_S:
                self._faults |= Status.OVERLOAD
        elif not self._faults & Status.OVERLOAD:
            self._overload_s = 0.0
        volts = self._volts()
        out_of_range = not self.get("min_voltage") <= volts * 10 <= self.get("max_voltage")
        status = self._faults | (Status.VOLTAGE if out_of_range else 0)
        if status != self.memory[65]:
            self.put("status", status)
            self._update_drive(self._time_s or 0.0)

    def _volts(self) -> float:
        return self.supply.volts - 0.15 * self.joint.current_a

    def _measure(self) -> None:
        joint = self.joint
        speed = max(-32767, min(32767, round(joint.velocity)))
        load = round(joint.load * 1000)
        _FEEDBACK.pack_into(
            self.memory,
            _FEEDBACK_START,
            self.present(),
            abs(speed) | (speed < 0) << 15,
            abs(load) | (load < 0) << 10,
            max(0, min(254, round(self._volts() * 10))),
            max(0, min(254, round(joint.temperature_c))),
            int(self.pending is not None),
            self.status,
            int(joint.velocity != 0.0),
            int.from_bytes(self.memory[42:44], "little"),
            round(joint.current_a / CURRENT_UNIT_A) | (load < 0) << 15,
        )

    def _retarget(self, written: Collection[str]) -> None:
        """Update the target of the shaft after a write to goal registers."""
        if self.get("mode") == 0:
            self._target = self.angle_of(self._limited(self.get("goal_position")))
        elif "goal_position" in written:
            self._target = self.joint.angle + self.get("goal_position")
        else:
            self._target = self.joint.angle

    def _update_drive(self, now_s: float) -> None:
        enabled = self.get("torque_enable") == 1
        unloading = self.memory[65] & self.get("unload_condition") & ~Status.OVERLOAD
        energised = enabled and not unloading
        self._set_drive(self._make_drive() if energised else None, now_s)

    def _make_drive(self) -> Drive:
        limit = self.get("torque_limit") / 1000
        if self._faults & Status.OVERLOAD:
            limit = min(limit, self.get("protective_torque") / 100)
        fastest = self.get("max_speed") * 50.0
        goal_speed = self.get("goal_speed")
        mode = self.get("mode")
        target = self._target
        if mode == 1:
            target = float(goal_speed)
        elif mode == 2:
            target = fastest * self.get("goal_time") / 1000
        return Drive(
            mode="position" if mode in (0, 3) else "speed",
            target=target,
            speed_limit=min(abs(goal_speed) or fastest, fastest),
            acceleration=(self.get("acceleration") or 254) * 100.0,
            torque_limit=limit,
            stiffness=self.get("position_p") * STIFFNESS,
        )

    def _limited(self, goal: int) -> int:
        low, high = self.get("min_position_limit"), self.get("max_position_limit")
        return goal if low == high == 0 else max(low, min(high, goal))

"""Puts an emulated Feetech bus together from its description."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

from joshua_emulator.arms import ARMS, mounted_middle
from joshua_emulator.control import ControlServer
from joshua_emulator.eeprom_store import EepromStore
from joshua_emulator.event_log import EventLog
from joshua_emulator.faults import Faults
from joshua_emulator.feetech.bus import FeetechBus
from joshua_emulator.feetech.operations import Operations
from joshua_emulator.feetech.registers import BAUDRATES, EEPROM_END, EEPROM_START
from joshua_emulator.feetech.servo import MIDDLE, Servo, Supply
from joshua_emulator.joint import Joint
from joshua_emulator.pty_line import PtyLine
from joshua_emulator.station import Station

FREE_HALF_RANGE = 2040.0  # ticks to either side, for servos that are no arm


@dataclass(frozen=True)
class FeetechSpec:
    """What a Feetech bus is to look like.

    Attributes:
        ids: bus ids in cable order.
        root: folder for device names, see ``PtyLine``; name: device name; identity: USB serial number.
        control: path of the control socket.
        eeprom: file that keeps EEPROM contents; None keeps nothing.
        arm: name of a known arm, or "" for servos without stops.
        calibrated: the EEPROM holds homing offsets and limits that put 2048 in the middle of each range.
        baudrate: line speed of the servos; return_delay_s: of each servo, in steps of 2 µs.
        models: model numbers in cable order where they are not the STS3215's.
        volts: of the supply; seed: of the line faults; echo: the adapter returns what the host sends.
    """

    ids: tuple[int, ...]
    root: Path
    control: Path
    name: str = "ttyACM0"
    identity: str = "EMULATED0"
    eeprom: Path | None = None
    arm: str = ""
    calibrated: bool = False
    baudrate: int = 1_000_000
    return_delay_s: float = 0.0
    models: tuple[int, ...] = ()
    volts: float = 12.0
    seed: int = 0
    echo: bool = False
    burst_window_s: float = 0.0005


class FeetechAssembly:
    """An emulated bus, ready to run: its station and its operations."""

    def __init__(self, spec: FeetechSpec) -> None:
        self.spec = spec
        self.log = EventLog()
        self._supply = Supply(spec.volts)
        self._store = EepromStore(spec.eeprom, spec.identity)
        self._store.load()
        servos = [self._make_servo(slot, servo_id) for slot, servo_id in enumerate(spec.ids)]
        faults = Faults(spec.seed)
        bus = FeetechBus(servos, self.log, faults, echo=spec.echo)
        self.operations = Operations(
            bus,
            self._supply,
            faults,
            self.log,
            self.joint_names,
            lambda servo_id: self._extra_servo(bus, servo_id),
        )
        line = PtyLine(spec.root, spec.identity)
        control = ControlServer(spec.control, self.operations.handle)
        self.station = Station(bus, line, self.log, control, burst_window_s=spec.burst_window_s)
        self.operations.station = self.station

    @property
    def joint_names(self) -> list[str]:
        """Names of the joints in cable order."""
        arm = ARMS.get(self.spec.arm, ())
        numbered = [f"joint_{servo_id}" for servo_id in self.spec.ids]
        return [joint.name for joint in arm][: len(numbered)] + numbered[len(arm) :]

    def close(self) -> None:
        """Takes the device names and the control socket away."""
        self.station.line.unplug()
        self.station.control.close()

    def _make_servo(self, slot: int, servo_id: int) -> Servo:
        arm = ARMS.get(self.spec.arm, ())
        half = arm[slot].half_range_ticks if slot < len(arm) else FREE_HALF_RANGE
        middle = mounted_middle(self.spec.identity, slot) if arm else MIDDLE
        stored = self._store.image(slot)
        servo = Servo(
            Joint(float(middle), middle - half, middle + half),
            self._supply,
            stored,
            on_eeprom=lambda image: self._store.save(slot, image),
            on_torque=self._note_torque,
        )
        if stored is None:
            self._set_up(servo, slot, servo_id, middle, half)
        if slot < len(self.spec.models):
            servo.put("model_number", self.spec.models[slot])
        return servo

    def _set_up(self, servo: Servo, slot: int, servo_id: int, middle: int, half: float) -> None:
        servo.put("id", servo_id)
        servo.put("baudrate", next(code for code, rate in BAUDRATES.items() if rate == self.spec.baudrate))
        servo.put("return_delay", min(254, round(self.spec.return_delay_s / 2e-6)))
        if self.spec.calibrated:
            servo.put("homing_offset", middle - MIDDLE)
            servo.put("min_position_limit", max(0, round(MIDDLE - half)))
            servo.put("max_position_limit", min(4095, round(MIDDLE + half)))
        self._store.save(slot, bytes(servo.memory[EEPROM_START:EEPROM_END]))
        servo.power_on()

    def _extra_servo(self, bus: FeetechBus, servo_id: int) -> Servo:
        """A stranger on the cable: another position and temperature than the servo whose id it shares."""
        servo = Servo(Joint(1000.0, 0.0, 4095.0), self._supply, on_torque=self._note_torque)
        servo.put("id", servo_id)
        servo.put("baudrate", bus.servos[0].memory[6])
        servo.joint.temperature_c = servo.joint.ambient_c = 41.0
        servo.power_on()
        return servo

    def _note_torque(self, servo: Servo, energised: bool, now_s: float) -> None:
        # the drive can change a little ahead of the clock, at the end of a request that is still on the line
        self.log.add("torque", max(now_s, time.monotonic()), id=servo.servo_id, on=energised)

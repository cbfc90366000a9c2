"""Assembly of an emulated servo bus from its description."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic

from joshua_emulator.arms import ARMS, mounted_middle
from joshua_emulator.control import ControlServer
from joshua_emulator.eeprom_store import EepromStore
from joshua_emulator.event_log import EventLog
from joshua_emulator.faults import Faults
from joshua_emulator.joint import Joint
from joshua_emulator.motion import MIDDLE
from joshua_emulator.physics_link import PERIOD_S, CoupledJoint, PhysicsLink
from joshua_emulator.pty_line import PtyLine
from joshua_emulator.servo_bus.bus import EmulatedServoBus, ServoT
from joshua_emulator.servo_bus.operations import Operations
from joshua_emulator.station import Station

FREE_HALF_RANGE = 2040.0  # ticks to either side, for servos that are not an arm

NoteTorque = Callable[[Any, bool, float], None]


class SpecError(ValueError):
    """An invalid description of a bus. The message says what is allowed."""


@dataclass(frozen=True)
class BusSpec:
    """Description of a servo bus.

    Attributes:
        ids: bus ids in cable order.
        root: folder for device names, see ``PtyLine``; name: device name; identity: USB serial number.
        control: path of the control socket.
        eeprom: file that keeps EEPROM contents; None keeps nothing.
        arm: name of a known arm, or "" for servos without stops.
        calibrated: the EEPROM holds homing offsets and limits that put 2048 in the middle of each range.
        baudrate: line speed of the servos; return_delay_s: of each servo, in steps of 2 µs.
        models: model of each servo in cable order; the family says how a model is named.
        volts: of the supply, None for what the servos are made for.
        physics: socket of a simulation that moves the joints, None for the emulator's own motion;
            physics_actuators: of its model in cable order; physics_start_rad: where they are at first, about
            the middle of their ranges.
        seed: of the line faults; echo: the adapter returns what the host sends.
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
    models: tuple[str, ...] = ()
    volts: float | None = None
    seed: int = 0
    echo: bool = False
    burst_window_s: float = 0.0005
    physics: Path | None = None
    physics_actuators: tuple[str, ...] = ()
    physics_start_rad: tuple[float, ...] = ()


class BusAssembly(ABC, Generic[ServoT]):
    """An emulated bus, ready to run: its station and its operations."""

    def __init__(self, spec: BusSpec) -> None:
        self.spec = spec
        self.log = EventLog()
        self._store = EepromStore(spec.eeprom, spec.identity)
        self._store.load()
        self._coupled: list[CoupledJoint] = []
        servos = [self._place(slot, servo_id) for slot, servo_id in enumerate(spec.ids)]
        faults = Faults(spec.seed)
        bus = self.make_bus(servos, faults)
        self.operations = Operations(
            bus, faults, self.log, self.joint_names, lambda servo_id: self._extra_servo(bus, servo_id)
        )
        line = PtyLine(spec.root, spec.identity)
        control = ControlServer(spec.control, self.operations.handle)
        self.station = Station(bus, line, self.log, control, burst_window_s=spec.burst_window_s)
        self.operations.station = self.station
        if spec.physics is not None:
            self._couple(spec.physics, servos)

    @abstractmethod
    def make_bus(self, servos: Sequence[ServoT], faults: Faults) -> EmulatedServoBus[ServoT]:
        """Make the bus of the family's protocol."""

    @abstractmethod
    def make_servo(
        self,
        slot: int,
        joint: Joint,
        stored: bytes | None = None,
        on_eeprom: Callable[[bytes], None] = lambda _: None,
    ) -> ServoT:
        """Make one servo; ``on_eeprom`` gets its EEPROM after each change, ``stored`` is the last one."""

    @abstractmethod
    def set_up(self, servo: ServoT, servo_id: int, middle: int, half: float) -> bytes:
        """Configure a factory-new servo with its id and the spec. Return its EEPROM.

        Args:
            middle: encoder tick at the middle of the joint's range; half: half of that range in ticks.
        """

    def slot_key(self, slot: int) -> str:
        """Return the storage key of a servo's EEPROM."""
        return str(slot)

    @property
    def joint_names(self) -> list[str]:
        """Names of the joints in cable order."""
        arm = ARMS.get(self.spec.arm, ())
        numbered = [f"joint_{servo_id}" for servo_id in self.spec.ids]
        return [joint.name for joint in arm][: len(numbered)] + numbered[len(arm) :]

    def close(self) -> None:
        """Remove the device names and the control socket."""
        self.station.line.unplug()
        self.station.control.close()

    def note_torque(self, servo: ServoT, energised: bool, now_s: float) -> None:
        """Log that torque of a motor turned on or off."""
        # the drive can change a little ahead of the clock, at the end of a request that is still on the line
        self.log.add("torque", max(now_s, time.monotonic()), id=servo.servo_id, on=energised)

    def _place(self, slot: int, servo_id: int) -> ServoT:
        arm = ARMS.get(self.spec.arm, ())
        half = arm[slot].half_range_ticks if slot < len(arm) else FREE_HALF_RANGE
        middle = mounted_middle(self.spec.identity, slot) if arm else MIDDLE
        key = self.slot_key(slot)
        stored = self._store.image(key)
        joint = self._make_joint(slot, float(middle), half)
        servo = self.make_servo(slot, joint, stored, lambda image: self._store.save(key, image))
        if stored is None:
            self._store.save(key, self.set_up(servo, servo_id, middle, half))
        return servo

    def _make_joint(self, slot: int, middle: float, half: float) -> Joint:
        if self.spec.physics is None:
            return Joint(middle, middle - half, middle + half)
        starts = self.spec.physics_start_rad
        start_rad = starts[slot] if slot < len(starts) else 0.0
        joint = CoupledJoint(middle, middle - half, middle + half, start_rad)
        self._coupled.append(joint)
        return joint

    def _couple(self, path: Path, servos: Sequence[ServoT]) -> None:
        link = PhysicsLink(path, self.spec.physics_actuators, self._coupled)

        def turn() -> None:
            self.station.at(PERIOD_S, turn)
            now_s = time.monotonic()
            for servo in servos:  # so that the joints follow the last command before a pause on the bus
                servo.advance(now_s)
            link.exchange()

        self.station.at(0.0, turn)

    def _extra_servo(self, bus: EmulatedServoBus[ServoT], servo_id: int) -> ServoT:
        """Create a servo with a duplicate id, at another position and temperature."""
        servo = self.make_servo(0, Joint(1000.0, 0.0, 4095.0))
        servo.put("id", servo_id)
        servo.put("baudrate", bus.servos[0].get("baudrate"))
        servo.put("return_delay", bus.servos[0].get("return_delay"))
        servo.joint.temperature_c = servo.joint.ambient_c = 41.0
        servo.power_on()
        return servo

"""Servo buses outside a run: find servos, and assign id and line speed to one."""

from __future__ import annotations

import contextlib
import time
from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

from joshua.api import DeviceDisconnected, DeviceError
from joshua.api.clocks import witness
from joshua_serial.errors import PortDisconnected, PortUnusable

from joshua_servo.bus import REPLY_MARGIN_S, ServoBus
from joshua_servo.bus_tools import AssignmentFailed, BusTools, FoundMotor
from joshua_servo.errors import NoReply
from joshua_servo.register import Register

SWEEP_MARGIN_S = 0.008  # for pings of all ids, most of which are unused
LIKELY_IDS = range(21)  # repeated with the full margin, because a busy host may miss a reply
ATTEMPTS = 3

#: For a servo that replied before but not now, more often because of a busy host than a disconnected servo.
PATIENT_MARGIN_S = 0.06


@dataclass(frozen=True)
class SetUp:
    """Data for setting up a servo of one family.

    Attributes:
        torque_enable, motor_id, baudrate: registers; codes: line speeds by their code in the register;
            other_codes: meaning of a code in some other sources.
        lock: register that protects the EEPROM from writes while it is 1; None if torque does that.
        working: further settings of a servo in an arm: position mode and immediate replies.
        quiet_s: after this time without a byte, no servo replies to a broadcast ping.
        calls: number of broadcast pings before the bus counts as empty.
        looks: number of passes through the line speeds while no servo is found or, if this process was
            stalled, through those without a servo.
    """

    torque_enable: Register
    motor_id: Register
    baudrate: Register
    codes: Mapping[int, int]
    working: Mapping[Register, int]
    other_codes: Mapping[int, int] = field(default_factory=dict)
    lock: Register | None = None
    quiet_s: float = 0.06
    calls: int = 2
    looks: int = 2


class ServoBusTools(BusTools):
    """Servos of one family on one port; a driver adds the bus of its protocol and its registers."""

    #: Makes the bus of the family's protocol.
    make_bus: ClassVar[type[ServoBus]]
    set_up: ClassVar[SetUp]

    @abstractmethod
    def read_motor(self, bus: ServoBus, servo_id: int) -> FoundMotor:
        """Read the data of a servo. Raises NoReply and PortDisconnected."""

    def scan(self, baudrates: Sequence[int] = ()) -> Iterator[FoundMotor]:
        """Search for servos at each line speed. Yield each immediately. Raises PortDisconnected."""
        clock = witness()
        with self._line_speed_kept():
            speeds = tuple(baudrates or self.baudrates)
            for _ in range(self.set_up.looks):
                began_s, found = time.monotonic(), set()
                for motor in self._look(speeds):
                    found.add(motor.baudrate)
                    yield motor
                if found and not clock.missed_s(began_s, time.monotonic()):
                    return
                speeds = tuple(speed for speed in speeds if speed not in found)

    def assign(self, motor: FoundMotor, motor_id: int, baudrate: int) -> FoundMotor:
        """Give one servo its id and line speed, position mode and immediate replies.

        Raises:
            AssignmentFailed: it did not accept them, or the id is in use.
            PortDisconnected: the adapter was unplugged meanwhile.
        """
        self._require_possible(motor, motor_id, baudrate)
        with self._line_speed_kept():
            self._require_free(motor, motor_id, baudrate)
            try:
                return self._assign(motor, motor_id, baudrate)
            except PortDisconnected:
                raise
            except DeviceError as error:
                raise AssignmentFailed(
                    f"{self.port}: id {motor.motor_id} did not become id {motor_id} at {baudrate} bit/s: "
                    f"{error} {self._roll_back(motor, motor_id, baudrate)}"
                ) from error

    def _assign(self, motor: FoundMotor, motor_id: int, baudrate: int) -> FoundMotor:
        bus = self._bus_at(motor.baudrate)
        assert bus is not None, "the motor was found at this speed"
        set_up = self.set_up
        _put(bus, motor.motor_id, set_up.torque_enable, 0)
        self._put_lock(bus, motor.motor_id, 0)
        for register, value in set_up.working.items():
            _put(bus, motor.motor_id, register, value)
        _put(bus, motor.motor_id, set_up.motor_id, motor_id, answers_as=motor_id)
        self._put_baudrate(bus, motor_id, baudrate)
        self._put_lock(bus, motor_id, 1)
        found = self._describe(bus, motor_id)
        if found is None or found.shared:
            raise NoReply("it did not answer when checked again.")
        return found

    def _put_lock(self, bus: ServoBus, servo_id: int, value: int) -> None:
        if self.set_up.lock is not None:
            _put(bus, servo_id, self.set_up.lock, value)

    def _put_baudrate(self, bus: ServoBus, servo_id: int, baudrate: int) -> None:
        """Write the line speed and switch to it. Raises DeviceError; the port then has its old speed."""
        former = self.port.baudrate
        if baudrate == former:
            return
        register = self.set_up.baudrate
        readings = (*self.set_up.codes.items(), *self.set_up.other_codes.items())
        codes = [code for code, speed in readings if speed == baudrate]
        for _ in range(ATTEMPTS):
            for code in codes:
                bus.try_write(servo_id, register, code)
                meant = [speed for other, speed in readings if other == code]
                for speed in sorted(meant, key=lambda speed: speed != baudrate):
                    self.port.set_baudrate(speed)
                    with contextlib.suppress(NoReply):
                        if bus.read(servo_id, register) == code:
                            break
                else:
                    self.port.set_baudrate(former)
                    continue
                if speed == baudrate:
                    return
            self.port.set_baudrate(former)
        raise NoReply(f"id {servo_id} does not answer at {baudrate} bit/s.")

    def _roll_back(self, motor: FoundMotor, motor_id: int, baudrate: int) -> str:
        """Restore id and line speed if the servo replies. Returns the present ones."""
        for speed in dict.fromkeys((motor.baudrate, baudrate)):
            for servo_id in dict.fromkeys((motor.motor_id, motor_id)):
                bus = self._bus_at(speed)
                if bus is None or not any(bus.ping(servo_id) for _ in range(ATTEMPTS)):
                    continue
                try:
                    self._put_lock(bus, servo_id, 0)
                    _put(bus, servo_id, self.set_up.motor_id, motor.motor_id, answers_as=motor.motor_id)
                    self._put_baudrate(bus, motor.motor_id, motor.baudrate)
                    self._put_lock(bus, motor.motor_id, 1)
                except NoReply:
                    return (
                        f"It could not be restored and last answered as id {servo_id} at {speed} "
                        "bit/s. Check its cable and the supply, then try again."
                    )
                return (
                    f"It answers as id {motor.motor_id} at {motor.baudrate} bit/s as before. "
                    "Check its cable and the supply, then try again."
                )
        return "It no longer answers. Check its cable and the supply, then try again."

    def _require_possible(self, motor: FoundMotor, motor_id: int, baudrate: int) -> None:
        if motor.shared:
            raise AssignmentFailed(
                f"{self.port}: several motors answer to id {motor.motor_id}, and all of them would take the "
                "new id. Connect one alone."
            )
        if motor_id not in self.ids:
            raise AssignmentFailed(f"{self.port}: {motor_id} is not a servo id: allowed 0 to {self.ids[-1]}.")
        if baudrate not in self.baudrates:
            allowed = ", ".join(map(str, self.baudrates))
            raise AssignmentFailed(f"{self.port}: no speed of {baudrate} bit/s: allowed {allowed}.")

    def _require_free(self, motor: FoundMotor, motor_id: int, baudrate: int) -> None:
        if (motor.motor_id, motor.baudrate) == (motor_id, baudrate):
            return
        for speed in dict.fromkeys((motor.baudrate, baudrate)):
            bus = self._bus_at(speed)
            if bus is None:
                raise AssignmentFailed(
                    f"{self.port}: this adapter cannot run at {speed} bit/s. Choose another line speed."
                )
            itself = (motor.motor_id, motor.baudrate) == (motor_id, speed)
            if not itself and any(bus.ping(motor_id) for _ in range(2)):
                raise AssignmentFailed(
                    f"{self.port}: id {motor_id} is taken by another motor at {speed} bit/s; two motors with "
                    "one id cannot be told apart. Choose another id, or disconnect that motor."
                )

    def _bus_at(self, baudrate: int) -> ServoBus | None:
        """A new bus at a line speed; None if the adapter does not support it."""
        try:
            self.port.set_baudrate(baudrate)
        except PortUnusable:
            return None
        bus = self.make_bus(self.port)
        bus.detect_echo()
        bus.reply_margin_s = max(bus.reply_margin_s, PATIENT_MARGIN_S)
        return bus

    def _look(self, baudrates: Sequence[int]) -> Iterator[FoundMotor]:
        """Search all line speeds once."""
        for baudrate in baudrates:
            bus = self._bus_at(baudrate)
            if bus is None:
                continue
            for servo_id in self._heard_ids(bus):
                motor = self._describe(bus, servo_id)
                if motor is not None:
                    yield motor

    def _heard_ids(self, bus: ServoBus) -> list[int]:
        """Ids of the servos at the present line speed."""
        for _ in range(self.set_up.calls):
            ids, is_garbled = bus.call_all(self.set_up.quiet_s)
            if is_garbled:
                return self._sweep(bus)
            if ids:
                return ids
        return []

    def _sweep(self, bus: ServoBus) -> list[int]:
        """Ping every valid id."""
        heard = bus.roll_call(self.ids, SWEEP_MARGIN_S)
        for _ in range(ATTEMPTS - 1):
            heard |= bus.roll_call((i for i in LIKELY_IDS if i not in heard), REPLY_MARGIN_S)
        return sorted(heard)

    def _describe(self, bus: ServoBus, servo_id: int) -> FoundMotor | None:
        """The data of a servo; None if it no longer replies."""
        try:
            return self.read_motor(bus, servo_id)
        except NoReply as error:
            return FoundMotor(servo_id, bus.port.baudrate, shared=True) if error.garbled else None

    @contextlib.contextmanager
    def _line_speed_kept(self) -> Iterator[None]:
        usual = self.port.baudrate
        try:
            yield
        finally:
            with contextlib.suppress(PortUnusable, DeviceDisconnected):
                self.port.set_baudrate(usual)


def _put(
    bus: ServoBus, servo_id: int, register: Register, value: int, *, answers_as: int | None = None
) -> None:
    """Write a register unless it already has the value, and read it back. Raises NoReply.

    Args:
        answers_as: id of the servo after the write.
    """
    reader = servo_id if answers_as is None else answers_as
    if reader == servo_id and bus.read(reader, register) == value:
        return
    kept: int | None = None
    for _ in range(ATTEMPTS):
        bus.try_write(servo_id, register, value)  # sets a servo that acknowledges nothing to acknowledge
        with contextlib.suppress(NoReply):
            kept = bus.read(reader, register)
            if kept == value:
                return
    if kept is None:
        raise NoReply(f"it did not answer after {register.name} was written.")
    raise NoReply(f"it keeps {register.name} at {kept} instead of {value}.")

"""STS3215 buses outside a run: which servos are there, and giving one its id and line speed."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence

from joshua.devices.bus_tools import AssignmentFailed, BusTools, FoundMotor
from joshua.devices.errors import DeviceDisconnected, DeviceError
from joshua.devices.serial_errors import PortDisconnected, PortUnusable
from joshua.devices.servo.errors import NoReply
from joshua.devices.servo.register import Register

from joshua_sts3215.bus import Bus
from joshua_sts3215.feedback import parse_feedback
from joshua_sts3215.registers import (
    BAUDRATE,
    BAUDRATES,
    FEEDBACK,
    ID,
    LOCK,
    MAX_TEMPERATURE,
    MODE,
    MODEL,
    MODEL_NAMES,
    MODEL_NUMBER,
    POSITION_MODE,
    RETURN_DELAY,
    STATUS_BITS,
    STATUS_LEVEL,
    TORQUE_ENABLE,
    TORQUE_OFF,
)

LARGEST_ID = 253
QUIET_S = 0.06  # a line without a byte for this long has nobody who answers
CALLS = 2
SWEEP_MARGIN_S = 0.008  # for pings of all ids, most of which nobody has
LIKELY_IDS = range(21)  # asked again with the full margin: a busy host may miss a reply
ATTEMPTS = 3

_VERSION = (0, MODEL.address + MODEL.width)  # firmware and model
_LIMITS = (MAX_TEMPERATURE.address, 3)  # °C, then the most and the least voltage in 0.1 V
_CODE_OF = {baudrate: code for code, baudrate in BAUDRATES.items()}
# What a servo of an arm needs beside its id: it moves to positions, and answers every request at once.
_WORKING = {MODE: POSITION_MODE, STATUS_LEVEL: 1, RETURN_DELAY: 0}


class Sts3215BusTools(BusTools):
    """Servos of the magnetic-encoder STS series on one port."""

    family = "STS3215 servos"
    baudrates = tuple(BAUDRATES.values())
    ids = range(LARGEST_ID + 1)
    expected_models = (MODEL_NAMES[MODEL_NUMBER],)

    def scan(self, baudrates: Sequence[int] = ()) -> Iterator[FoundMotor]:
        """Looks for servos at each line speed; yields each as it is found. Raises PortDisconnected."""
        with self._line_speed_kept():
            for baudrate in baudrates or self.baudrates:
                bus = self._bus_at(baudrate)
                if bus is None:
                    continue
                for servo_id in _heard_ids(bus):
                    motor = _describe(bus, servo_id)
                    if motor is not None:
                        yield motor

    def assign(self, motor: FoundMotor, motor_id: int, baudrate: int) -> FoundMotor:
        """Gives one servo its id and line speed, position mode and immediate replies.

        Raises:
            AssignmentFailed: it did not take them, or the id is taken.
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
        _put(bus, motor.motor_id, TORQUE_ENABLE, TORQUE_OFF)
        _put(bus, motor.motor_id, LOCK, 0)
        for register, value in _WORKING.items():
            _put(bus, motor.motor_id, register, value)
        _put(bus, motor.motor_id, ID, motor_id, answers_as=motor_id)
        self._put_baudrate(bus, motor_id, baudrate)
        _put(bus, motor_id, LOCK, 1)
        found = _describe(bus, motor_id)
        if found is None or found.shared:
            raise NoReply("it was silent when it was looked at again.")
        return found

    def _put_baudrate(self, bus: Bus, servo_id: int, baudrate: int) -> None:
        """Writes the line speed and follows it. Raises DeviceError; the port then has the former speed."""
        former = self.port.baudrate
        if baudrate == former:
            return
        for _ in range(ATTEMPTS):
            bus.try_write(servo_id, BAUDRATE, _CODE_OF[baudrate])
            self.port.set_baudrate(baudrate)
            with contextlib.suppress(NoReply):
                if bus.read(servo_id, BAUDRATE) == _CODE_OF[baudrate]:
                    return
            self.port.set_baudrate(former)
        raise NoReply(f"id {servo_id} does not answer at {baudrate} bit/s.")

    def _roll_back(self, motor: FoundMotor, motor_id: int, baudrate: int) -> str:
        """Puts id and line speed back as far as the servo answers; says what it answers to now."""
        for speed in dict.fromkeys((motor.baudrate, baudrate)):
            for servo_id in dict.fromkeys((motor.motor_id, motor_id)):
                bus = self._bus_at(speed)
                if bus is None or not any(bus.ping(servo_id) for _ in range(ATTEMPTS)):
                    continue
                try:
                    _put(bus, servo_id, LOCK, 0)
                    _put(bus, servo_id, ID, motor.motor_id, answers_as=motor.motor_id)
                    self._put_baudrate(bus, motor.motor_id, motor.baudrate)
                    _put(bus, motor.motor_id, LOCK, 1)
                except NoReply:
                    return (
                        f"It could not be put back either and was last heard as id {servo_id} at {speed} "
                        "bit/s. Check its cable and the supply, then try again."
                    )
                return (
                    f"It answers as id {motor.motor_id} at {motor.baudrate} bit/s as before. "
                    "Check its cable and the supply, then try again."
                )
        return "It does not answer any more. Check its cable and the supply, then try again."

    def _require_possible(self, motor: FoundMotor, motor_id: int, baudrate: int) -> None:
        if motor.shared:
            raise AssignmentFailed(
                f"{self.port}: several motors answer to id {motor.motor_id}, and all of them would take the "
                "new id. Connect one alone."
            )
        if motor_id not in self.ids:
            raise AssignmentFailed(f"{self.port}: {motor_id} is no id of a servo: allowed 0 to {LARGEST_ID}.")
        if baudrate not in _CODE_OF:
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
            if not itself and any(bus.ping(motor_id) for _ in range(CALLS)):
                raise AssignmentFailed(
                    f"{self.port}: id {motor_id} is taken by another motor at {speed} bit/s; two motors with "
                    "one id cannot be told apart. Choose another id, or disconnect that motor."
                )

    def _bus_at(self, baudrate: int) -> Bus | None:
        """A fresh bus at a line speed; None where the adapter cannot run at it."""
        try:
            self.port.set_baudrate(baudrate)
        except PortUnusable:
            return None
        bus = Bus(self.port)
        bus.detect_echo()
        return bus

    @contextlib.contextmanager
    def _line_speed_kept(self) -> Iterator[None]:
        usual = self.port.baudrate
        try:
            yield
        finally:
            with contextlib.suppress(PortUnusable, DeviceDisconnected):
                self.port.set_baudrate(usual)


def _heard_ids(bus: Bus) -> list[int]:
    """Ids of the servos at the present line speed."""
    for _ in range(CALLS):
        ids, is_garbled = bus.call_all(QUIET_S)
        if is_garbled:
            return _sweep(bus)
        if ids:
            return ids
    return []


def _sweep(bus: Bus) -> list[int]:
    """Pings every id there is."""
    bus.reply_margin_s, usual_s = SWEEP_MARGIN_S, bus.reply_margin_s
    heard = {servo_id for servo_id in range(LARGEST_ID + 1) if bus.ping(servo_id)}
    bus.reply_margin_s = usual_s
    heard |= {servo_id for servo_id in LIKELY_IDS if servo_id not in heard and bus.ping(servo_id)}
    return sorted(heard)


def _describe(bus: Bus, servo_id: int) -> FoundMotor | None:
    """Reads what a servo says of itself; None where it does not answer any more."""
    baudrate, corrupt = bus.port.baudrate, bus.counters.corrupt
    try:
        version = bus.read_block(servo_id, *_VERSION)
        limits = bus.read_block(servo_id, *_LIMITS)
        feedback = parse_feedback(bus.read_block(servo_id, *FEEDBACK))
    except NoReply:
        if bus.counters.corrupt - corrupt > bus.retries:
            return FoundMotor(servo_id, baudrate, shared=True)
        return None
    model = MODEL.decode(version[MODEL.address :])
    return FoundMotor(
        servo_id,
        baudrate,
        MODEL_NAMES.get(model, f"model {model}"),
        f"{version[0]}.{version[1]}",
        feedback.voltage_v,
        float(feedback.temperature_c),
        float(limits[0]),
        limits[2] / 10,
        limits[1] / 10,
        STATUS_BITS.describe(feedback.status),
    )


def _put(bus: Bus, servo_id: int, register: Register, value: int, *, answers_as: int | None = None) -> None:
    """Writes a register unless it holds the value already, and reads it back. Raises NoReply.

    Args:
        answers_as: id under which the servo answers once the register holds the value.
    """
    reader = servo_id if answers_as is None else answers_as
    if reader == servo_id and bus.read(reader, register) == value:
        return
    kept: int | None = None
    for _ in range(ATTEMPTS):
        bus.try_write(servo_id, register, value)  # a servo that acknowledges nothing is told to do so here
        with contextlib.suppress(NoReply):
            kept = bus.read(reader, register)
            if kept == value:
                return
    if kept is None:
        raise NoReply(f"it was silent after {register.name} was written.")
    raise NoReply(f"it keeps {register.name} at {kept} instead of {value}.")

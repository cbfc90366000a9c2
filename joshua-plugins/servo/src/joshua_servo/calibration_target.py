"""The calibration target for servos: encoder positions without torque, and their EEPROM."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import ClassVar

from joshua.api import DeviceError
from joshua.api.calibration import TICKS_PER_TURN
from joshua_calibration.target import CalibrationTarget, StoredMotor, TargetMotor, arm_motors
from joshua_serial.port import SerialPort
from joshua_serial.usb_ports import Endpoint

from joshua_servo.bus import ServoBus
from joshua_servo.errors import MotorCheckFailed
from joshua_servo.family import ServoFamily
from joshua_servo.inspection import ServoSetup
from joshua_servo.motor_check import check_motors
from joshua_servo.register import Register
from joshua_servo.settings import ServoSettings
from joshua_servo.torque import TorqueSwitch


class ServoCalibrationTarget(CalibrationTarget):
    """One arm. ``store`` changes the homing offsets; raw positions are the reported ones plus the offset."""

    family: ClassVar[ServoFamily]
    #: Registers of the EEPROM that a calibration writes.
    homing_offset: ClassVar[Register]
    min_position: ClassVar[Register]
    max_position: ClassVar[Register]
    #: 1 if the servo subtracts its homing offset, -1 if it adds it.
    offset_sign: ClassVar[int] = 1

    def __init__(self, settings: ServoSettings) -> None:
        self._settings = settings
        self._ids = settings.motor_ids
        self._motors = arm_motors(self._ids)
        self._port = SerialPort(
            Endpoint(settings.port, settings.serial_number, settings.vid_pid, settings.device_root),
            settings.baudrate,
        )
        self._bus = self.make_bus(self._port)
        self._torque = TorqueSwitch(
            self._bus, self.family, {motor.id: motor.joint_name for motor in self._motors}
        )
        self._offsets: dict[int, int] = {}

    @abstractmethod
    def make_bus(self, port: SerialPort) -> ServoBus:
        """Make the bus of the servos' protocol."""

    @property
    @abstractmethod
    def expected_models(self) -> dict[int, str]:
        """Expected model of each servo by its id."""

    @abstractmethod
    def read_setups(self) -> Sequence[ServoSetup]:
        """Read the EEPROM of all servos. Raises MotorCheckFailed if one has another working mode."""

    @property
    def motors(self) -> tuple[TargetMotor, ...]:
        """The servos in cable order."""
        return self._motors

    @property
    def identity(self) -> str:
        """Identity of the adapter."""
        return self._port.entry.identity

    @property
    def connected(self) -> bool:
        """Whether the port is open."""
        return self._port.is_open

    def connect(self) -> None:
        """Open the port and check that the servos reply and are in position mode."""
        self._port.open()
        try:
            self._bus.detect_echo()
            check_motors(self._bus, self.expected_models)
            setups = self.read_setups()
        except BaseException:
            self._port.close()
            raise
        self._offsets = {setup.servo_id: setup.homing_offset for setup in setups}
        entry, endpoint = self._port.entry, self._port.endpoint
        if entry.serial_number:  # follows this adapter under any name
            self._port.endpoint = Endpoint(
                endpoint.path, entry.serial_number, entry.vid_pid, endpoint.device_root
            )

    def disconnect(self) -> None:
        """Close the port."""
        self._port.close()

    def release(self) -> None:
        """Disable the torque of all servos and verify it."""
        self._require_open("release")
        self._torque.switch_off()

    def raw_positions(self) -> tuple[int, ...]:
        """Encoder positions in cable order."""
        self._require_open("raw_positions")
        present = self.family.present_position
        values = self._bus.sync_read(present.address, present.width, self._ids)
        missing = [servo_id for servo_id in self._ids if servo_id not in values]
        if missing:
            names = ", ".join(
                f"{motor.joint_name} (id {motor.id})" for motor in self._motors if motor.id in missing
            )
            raise self._bus.no_reply(f"no answer from {names}", "Check the cables and the supply.")
        return tuple(
            (present.decode(values[servo_id]) + self._offsets[servo_id]) % TICKS_PER_TURN
            for servo_id in self._ids
        )

    def stored(self) -> tuple[StoredMotor, ...]:
        """Homing offsets and limits in the EEPROM, in cable order."""
        self._require_open("stored")
        return tuple(
            StoredMotor(
                self.offset_sign * self._bus.read(servo_id, self.homing_offset),
                self._bus.read(servo_id, self.min_position),
                self._bus.read(servo_id, self.max_position),
            )
            for servo_id in self._ids
        )

    def store(self, motor_id: int, values: StoredMotor) -> None:
        """Write the EEPROM of one servo and read it back."""
        self._require_open("store")
        registers = {
            self.homing_offset: self.offset_sign * values.homing_offset,
            self.min_position: values.range_min,
            self.max_position: values.range_max,
        }
        self.refuse_unfit(motor_id, registers)
        self._bus.write_eeprom(motor_id, registers)
        self._offsets[motor_id] = values.homing_offset

    def _require_open(self, verb: str) -> None:
        if not self._port.is_open:
            raise DeviceError(f"{type(self).__name__}.{verb}: the device is not open: call connect first")

    def refuse_unfit(self, motor_id: int, registers: dict[Register, int]) -> None:
        """Refuse values that a servo cannot store, before anything is written. Raises DeviceError."""
        if motor_id not in self._ids:
            raise MotorCheckFailed(
                f"{self._port}: no motor {motor_id}; there are {', '.join(map(str, self._ids))}"
            )
        try:
            for register, value in registers.items():
                register.encode(value)
        except ValueError as error:
            raise DeviceError(f"{self._port}: id {motor_id}: {error}; repeat this joint") from error

"""The servos as a calibration sees them: encoder positions without torque, and their EEPROM."""

from __future__ import annotations

from joshua.devices.calibration_target import CalibrationTarget, StoredMotor, TargetMotor, arm_motors
from joshua.devices.errors import DeviceError
from joshua.devices.serial_port import SerialPort
from joshua.devices.servo.errors import MotorCheckFailed, NoReply
from joshua.devices.servo.motor_check import check_motors
from joshua.devices.servo.register import Register
from joshua.devices.servo.torque import TorqueSwitch
from joshua.devices.usb_ports import Endpoint

from joshua_sts3215.bus import Bus
from joshua_sts3215.family import STS3215
from joshua_sts3215.inspection import read_setups
from joshua_sts3215.registers import (
    HOMING_OFFSET,
    MAX_POSITION,
    MIN_POSITION,
    PRESENT_POSITION,
    TICKS_PER_TURN,
)
from joshua_sts3215.settings import Sts3215Settings


class Sts3215CalibrationTarget(CalibrationTarget):
    """One arm. The homing offsets stay as they are until ``store``: raw positions are what the servo reports
    plus its offset.
    """

    def __init__(self, settings: Sts3215Settings) -> None:
        self._settings = settings
        self._ids = settings.motor_ids
        self._motors = arm_motors(self._ids)
        self._port = SerialPort(
            Endpoint(settings.port, settings.serial_number, settings.vid_pid, settings.device_root),
            settings.baudrate,
        )
        self._bus = Bus(self._port)
        self._torque = TorqueSwitch(
            self._bus, STS3215, {motor.id: motor.joint_name for motor in self._motors}
        )
        self._offsets: dict[int, int] = {}

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
        """Opens the port and checks that the servos are there and work in position mode."""
        self._port.open()
        try:
            self._bus.detect_echo()
            check_motors(self._bus, self._settings.models)
            setups = read_setups(self._bus, self._ids)
        except BaseException:
            self._port.close()
            raise
        self._offsets = {setup.servo_id: setup.homing_offset for setup in setups}
        entry, endpoint = self._port.entry, self._port.endpoint
        if entry.serial_number:  # from now on this very adapter, whatever name it has
            self._port.endpoint = Endpoint(
                endpoint.path, entry.serial_number, entry.vid_pid, endpoint.device_root
            )

    def disconnect(self) -> None:
        """Closes the port."""
        self._port.close()

    def release(self) -> None:
        """Takes torque off all servos, verified."""
        self._torque.switch_off()

    def raw_positions(self) -> tuple[int, ...]:
        """Encoder positions in cable order."""
        values = self._bus.sync_read(PRESENT_POSITION.address, PRESENT_POSITION.width, self._ids)
        missing = [servo_id for servo_id in self._ids if servo_id not in values]
        if missing:
            names = ", ".join(
                f"{motor.joint_name} (id {motor.id})" for motor in self._motors if motor.id in missing
            )
            raise NoReply(f"{self._port}: no answer from {names}. Check the cables and the supply.")
        return tuple(
            (PRESENT_POSITION.decode(values[servo_id]) + self._offsets[servo_id]) % TICKS_PER_TURN
            for servo_id in self._ids
        )

    def stored(self) -> tuple[StoredMotor, ...]:
        """Homing offsets and limits in the EEPROM, in cable order."""
        return tuple(
            StoredMotor(
                self._bus.read(servo_id, HOMING_OFFSET),
                self._bus.read(servo_id, MIN_POSITION),
                self._bus.read(servo_id, MAX_POSITION),
            )
            for servo_id in self._ids
        )

    def store(self, motor_id: int, values: StoredMotor) -> None:
        """Unlocks, writes, reads back and locks the EEPROM of one servo."""
        registers = {
            HOMING_OFFSET: values.homing_offset,
            MIN_POSITION: values.range_min,
            MAX_POSITION: values.range_max,
        }
        self._refuse_unfit(motor_id, registers)
        self._bus.write_eeprom(motor_id, registers)
        self._offsets[motor_id] = values.homing_offset

    def _refuse_unfit(self, motor_id: int, registers: dict[Register, int]) -> None:
        """Refuses what a register cannot hold before the first one is written."""
        if motor_id not in self._ids:
            raise MotorCheckFailed(
                f"{self._port}: no motor {motor_id}; there are {', '.join(map(str, self._ids))}"
            )
        try:
            for register, value in registers.items():
                register.encode(value)
        except ValueError as error:
            raise DeviceError(f"{self._port}: id {motor_id}: {error}; repeat this joint") from error

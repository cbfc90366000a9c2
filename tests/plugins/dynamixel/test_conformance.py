"""The conformance checks that actuators, bus tools and calibration targets must pass, on emulated servos."""

from typing import ClassVar

from joshua.devices.actuator import Actuator
from joshua.testing import check_actuator
from joshua_calibration.target import CalibrationTarget
from joshua_calibration.testing import check_calibration_target
from joshua_dynamixel.actuator import DynamixelActuator
from joshua_dynamixel.bus_tools import DynamixelBusTools
from joshua_dynamixel.settings import DynamixelSettings
from joshua_emulator import EmulatedBus
from joshua_serial.port import SerialPort
from joshua_serial.usb_ports import Endpoint
from joshua_servo.bus_tools import BusTools
from joshua_servo.testing import check_bus_tools
from patience import patient


def test_the_driver_keeps_the_contract_of_actuators(arm_emulator: EmulatedBus) -> None:
    settings = DynamixelSettings.model_validate(
        {
            "serial_number": "KOCH1",
            "device_root": str(arm_emulator.root),
            "motor_ids": [1, 2, 3, 4, 5, 6],
            "models": ["xl330-m077"],
            "calibration": arm_emulator.calibration(),
        }
    )

    def unplug(device: Actuator) -> None:
        arm_emulator.fault("unplug")

    def make() -> Actuator:
        arm = DynamixelActuator(settings)
        patient(arm.bus)
        return arm

    check_actuator(make, unplug=unplug, timeout_s=60.0)


class FewIds(DynamixelBusTools):
    """A few of the ids and line speeds, for the sake of time."""

    ids: ClassVar[range] = range(12)
    baudrates: ClassVar[tuple[int, ...]] = (1_000_000, 57_600)


def test_its_tools_keep_the_contract_of_bus_tools(emulator: EmulatedBus) -> None:
    def make() -> BusTools:
        port = SerialPort(Endpoint(emulator.port, device_root=str(emulator.root)), 1_000_000)
        port.open()
        return FewIds(port)

    clauses = (
        "constructor",
        "description",
        "scan",
        "assign",
        "refused",
    )  # each look takes these servos 0.8 s
    check_bus_tools(make, only=clauses)


def test_its_target_keeps_the_contract_of_calibration_targets(arm_emulator: EmulatedBus) -> None:
    settings = DynamixelSettings.model_validate(
        {
            "port": arm_emulator.port,
            "device_root": str(arm_emulator.root),
            "motor_ids": [1, 2, 3, 4, 5, 6],
            "models": ["xl330-m077"],
        }
    )

    def make() -> CalibrationTarget:
        target = DynamixelActuator(settings).calibration_target()
        patient(target._bus)
        return target

    def hand(joint: int | None, seconds: float) -> bool:
        arm_emulator.guide(joint, seconds)
        return True

    arm_emulator.servos()  # opens the channel through which the test itself speaks to the emulator
    check_calibration_target(make, hand=hand, unplug=lambda target: arm_emulator.fault("unplug"))

"""The conformance checks that actuators, bus tools and calibration targets must pass, on emulated servos."""

from typing import ClassVar

from joshua.devices.actuator import Actuator
from joshua.testing import check_actuator
from joshua_calibration.target import CalibrationTarget
from joshua_calibration.testing import check_calibration_target
from joshua_emulator import EmulatedBus
from joshua_serial.port import SerialPort
from joshua_serial.usb_ports import Endpoint
from joshua_servo.bus_tools import BusTools
from joshua_servo.testing import check_bus_tools
from joshua_sts3215.actuator import Sts3215Actuator
from joshua_sts3215.bus_tools import Sts3215BusTools
from joshua_sts3215.settings import Sts3215Settings
from patience import patient


def test_the_driver_keeps_the_contract_of_actuators(arm_emulator: EmulatedBus) -> None:
    settings = Sts3215Settings.model_validate(
        {
            "serial_number": "ARM1",
            "device_root": str(arm_emulator.root),
            "motor_ids": [1, 2, 3, 4, 5, 6],
            "calibration": arm_emulator.calibration(),
        }
    )

    def unplug(device: Actuator) -> None:
        arm_emulator.fault("unplug")

    def make() -> Actuator:
        arm = Sts3215Actuator(settings)
        patient(arm.bus)
        return arm

    check_actuator(make, unplug=unplug, timeout_s=60.0)


class FewIds(Sts3215BusTools):
    """A few of the ids and line speeds, for the sake of time."""

    ids: ClassVar[range] = range(12)
    baudrates: ClassVar[tuple[int, ...]] = (1_000_000, 115_200)


def test_its_tools_keep_the_contract_of_bus_tools(emulator: EmulatedBus) -> None:
    def make() -> BusTools:
        port = SerialPort(Endpoint(emulator.port, device_root=str(emulator.root)), 1_000_000)
        port.open()
        return FewIds(port)

    check_bus_tools(make, unplug=lambda tools: emulator.fault("unplug"))


def test_its_target_keeps_the_contract_of_calibration_targets(arm_emulator: EmulatedBus) -> None:
    settings = Sts3215Settings.model_validate(
        {
            "port": arm_emulator.port,
            "device_root": str(arm_emulator.root),
            "motor_ids": [1, 2, 3, 4, 5, 6],
        }
    )

    def make() -> CalibrationTarget:
        target = Sts3215Actuator(settings).calibration_target()
        patient(target._bus)
        return target

    def hand(joint: int | None, seconds: float) -> bool:
        arm_emulator.guide(joint, seconds)
        return True

    arm_emulator.servos()  # opens the channel through which the test itself speaks to the emulator
    check_calibration_target(make, hand=hand, unplug=lambda target: arm_emulator.fault("unplug"))

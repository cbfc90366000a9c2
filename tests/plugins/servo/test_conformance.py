"""The conformance checks that actuators, bus tools and calibration targets must pass, on emulated servos."""

from __future__ import annotations

from joshua.devices.actuator import Actuator
from joshua.testing import check_actuator
from joshua_calibration.target import CalibrationTarget
from joshua_calibration.testing import check_calibration_target
from joshua_emulator import EmulatedBus
from joshua_serial.port import SerialPort
from joshua_serial.usb_ports import Endpoint
from joshua_servo.bus_tools import BusTools
from joshua_servo.testing import check_bus_tools
from patience import patient
from servo_families import Kind

BRIEF = ("constructor", "description", "scan", "assign", "refused")


def test_the_driver_keeps_the_contract_of_actuators(kind: Kind, arm_emulator: EmulatedBus) -> None:
    values = kind.settings_of(arm_emulator, port="", serial_number="ARM1")
    settings = kind.settings_type.model_validate(values)

    def make() -> Actuator:
        arm = kind.actuator(settings)
        patient(arm.bus)
        return arm

    check_actuator(make, unplug=lambda device: arm_emulator.fault("unplug"), timeout_s=60.0)


def test_its_tools_keep_the_contract_of_bus_tools(kind: Kind, emulator: EmulatedBus) -> None:
    # A few of the ids and line speeds, for the sake of time.
    few = {"ids": range(12), "baudrates": (1_000_000, kind.other_baudrate)}
    tools_of_few = type("FewIds", (kind.tools,), few)

    def make() -> BusTools:
        port = SerialPort(Endpoint(emulator.port, device_root=str(emulator.root)), 1_000_000)
        port.open()
        tools: BusTools = tools_of_few(port)
        return tools

    only = BRIEF if kind.is_slow_to_scan else ()
    check_bus_tools(make, unplug=None if only else lambda tools: emulator.fault("unplug"), only=only)


def test_its_target_keeps_the_contract_of_calibration_targets(kind: Kind, arm_emulator: EmulatedBus) -> None:
    def make() -> CalibrationTarget:
        return kind.target(arm_emulator)

    def hand(joint: int | None, seconds: float) -> bool:
        arm_emulator.guide(joint, seconds)
        return True

    arm_emulator.servos()  # opens the channel through which the test itself speaks to the emulator
    check_calibration_target(make, hand=hand, unplug=lambda target: arm_emulator.fault("unplug"))

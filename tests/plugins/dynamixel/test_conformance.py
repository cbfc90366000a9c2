"""The conformance check that any actuator must pass, on an emulated arm."""

from joshua.devices.actuator import Actuator
from joshua.testing import check_actuator
from joshua_dynamixel.actuator import DynamixelActuator
from joshua_dynamixel.settings import DynamixelSettings
from joshua_emulator import EmulatedBus


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

    check_actuator(lambda: DynamixelActuator(settings), unplug=unplug, timeout_s=30.0)

"""The conformance check that any actuator must pass, on an emulated arm."""

from joshua.devices.actuator import Actuator
from joshua.testing import check_actuator
from joshua_emulator import EmulatedBus
from joshua_sts3215.actuator import Sts3215Actuator
from joshua_sts3215.settings import Sts3215Settings


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

    check_actuator(lambda: Sts3215Actuator(settings), unplug=unplug, timeout_s=30.0)

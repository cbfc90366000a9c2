"""The families of servo buses that drivers share their code for: emulators and drivers of each."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from joshua_dynamixel import safe_stop as dynamixel_stop
from joshua_dynamixel.actuator import DynamixelActuator
from joshua_dynamixel.bus import Bus as DynamixelBus
from joshua_dynamixel.family import X_SERIES
from joshua_dynamixel.settings import DynamixelSettings
from joshua_emulator import EmulatedBus
from joshua_serial.port import SerialPort
from joshua_serial.usb_ports import Endpoint
from joshua_servo.arm import ServoArm
from joshua_servo.bus import ServoBus
from joshua_servo.family import ServoFamily
from joshua_servo.safe_stop import SafeStopReport, SafeStopRequest
from joshua_servo.settings import ServoSettings
from joshua_sts3215 import safe_stop as sts3215_stop
from joshua_sts3215.actuator import Sts3215Actuator
from joshua_sts3215.bus import Bus as Sts3215Bus
from joshua_sts3215.family import STS3215
from joshua_sts3215.settings import Sts3215Settings


@dataclass(frozen=True)
class Kind:
    """One family.

    Attributes:
        package: of the driver; protocol: of the emulator; arm: the emulated arm that is usual for it.
        settings: what its block needs beside port and ids; slow: a speed of about 0.3 rad/s.
    """

    package: str
    protocol: str
    arm: str
    family: ServoFamily
    bus: type[ServoBus]
    actuator: type[ServoArm]
    settings_type: type[ServoSettings]
    stop: Callable[[SafeStopRequest], SafeStopReport]
    slow: Mapping[str, int]
    settings: Mapping[str, Any] = field(default_factory=dict)

    def emulated_bus(self, ids: tuple[int, ...] = (1, 2, 3), **options: Any) -> EmulatedBus:
        """Servos without stops."""
        return EmulatedBus(self.protocol, ids=ids, **options)

    def emulated_arm(self) -> EmulatedBus:
        """A calibrated arm."""
        return EmulatedBus(self.protocol, arm=self.arm, calibrated=True, identity="ARM1")

    def settings_of(self, emulator: EmulatedBus, **values: Any) -> dict[str, Any]:
        """Settings of a driver for a calibrated arm."""
        return {
            "port": emulator.port,
            "device_root": str(emulator.root),
            "motor_ids": [1, 2, 3, 4, 5, 6],
            "calibration": emulator.calibration(),
            **self.settings,
            **values,
        }

    def driver(self, emulator: EmulatedBus, **values: Any) -> ServoArm:
        """A driver for a calibrated arm."""
        return self.actuator(self.settings_type.model_validate(self.settings_of(emulator, **values)))

    @contextmanager
    def open_bus(self, emulator: EmulatedBus, **options: Any) -> Iterator[ServoBus]:
        """An open bus on an emulator."""
        port = SerialPort(Endpoint(emulator.port, device_root=str(emulator.root)), 1_000_000)
        port.open()
        try:
            bus = self.bus(port, **options)
            bus.detect_echo()
            yield bus
        finally:
            port.close()

    def position(self, data: bytes) -> int:
        """Position in ticks behind the bytes of its register."""
        return self.family.present_position.decode(data)


KINDS = (
    Kind(
        package="joshua_sts3215",
        protocol="feetech",
        arm="so_arm100",
        family=STS3215,
        bus=Sts3215Bus,
        actuator=Sts3215Actuator,
        settings_type=Sts3215Settings,
        stop=sts3215_stop.run,
        slow={"velocity_ticks_s": 200},
    ),
    Kind(
        package="joshua_dynamixel",
        protocol="dynamixel",
        arm="koch",
        family=X_SERIES,
        bus=DynamixelBus,
        actuator=DynamixelActuator,
        settings_type=DynamixelSettings,
        stop=dynamixel_stop.run,
        slow={"velocity": 13},
        settings={"models": ["xl330-m077"]},
    ),
)

"""The families of servo buses that drivers share their code for: emulators and drivers of each."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from joshua.devices.context import ActuatorContext
from joshua.plan import ActuatorFacts
from joshua_dynamixel.actuator import DynamixelActuator
from joshua_dynamixel.bus import Bus as DynamixelBus
from joshua_dynamixel.bus_tools import DynamixelBusTools
from joshua_dynamixel.family import X_SERIES
from joshua_dynamixel.safe_stop import DynamixelStopRequest
from joshua_dynamixel.settings import DynamixelSettings
from joshua_emulator import EmulatedBus
from joshua_serial.port import SerialPort
from joshua_serial.usb_ports import Endpoint
from joshua_servo.arm import ServoArm
from joshua_servo.bus import ServoBus
from joshua_servo.calibration_target import ServoCalibrationTarget
from joshua_servo.family import ServoFamily
from joshua_servo.safe_stop import SafeStopReport, ServoStopRequest, run
from joshua_servo.servo_bus_tools import ServoBusTools
from joshua_servo.settings import ServoSettings
from joshua_sts3215.actuator import Sts3215Actuator
from joshua_sts3215.bus import Bus as Sts3215Bus
from joshua_sts3215.bus_tools import Sts3215BusTools
from joshua_sts3215.family import STS3215
from joshua_sts3215.safe_stop import Sts3215StopRequest
from joshua_sts3215.settings import Sts3215Settings
from patience import patient


@dataclass(frozen=True)
class Kind:
    """One family.

    Attributes:
        package: of the driver; protocol: of the emulator; arm: the emulated arm that is usual for it.
        settings: what its block needs beside port and ids; slow: a speed of about 0.3 rad/s.
        paced: settings of speed and acceleration, and the registers that then hold them.
        offset_sign: of the homing offset that a servo stores, against that of a calibration.
        other_baudrate: a line speed beside the usual one; is_slow_to_scan: each scan takes most of a second.
    """

    package: str
    protocol: str
    arm: str
    family: ServoFamily
    bus: type[ServoBus]
    actuator: type[ServoArm]
    settings_type: type[ServoSettings]
    stop_request: type[ServoStopRequest]
    tools: type[ServoBusTools]
    slow: Mapping[str, Any]
    paced: tuple[Mapping[str, Any], Mapping[str, Any]]
    offset_sign: int
    other_baudrate: int
    is_slow_to_scan: bool
    settings: Mapping[str, Any] = field(default_factory=dict)

    def stop(self, request: ServoStopRequest) -> SafeStopReport:
        """Applies a safe state without a driver."""
        return run(request, self.family, self.bus)

    def emulated_bus(self, ids: tuple[int, ...] = (1, 2, 3), **options: Any) -> EmulatedBus:
        """Servos without stops."""
        return EmulatedBus(self.protocol, ids=ids, **options)

    def emulated_arm(self, identity: str = "ARM1") -> EmulatedBus:
        """A calibrated arm."""
        return EmulatedBus(self.protocol, arm=self.arm, calibrated=True, identity=identity)

    def settings_of(self, emulator: EmulatedBus, *, calibrated: bool = True, **values: Any) -> dict[str, Any]:
        """Settings of a driver for all servos of an emulator."""
        return {
            "port": emulator.port,
            "device_root": str(emulator.root),
            "motor_ids": [servo["id"] for servo in emulator.servos()],
            "calibration": emulator.calibration() if calibrated else None,
            **self.settings,
            **values,
        }

    def driver(
        self,
        emulator: EmulatedBus,
        facts: dict[str, Any] | None = None,
        *,
        remembered: dict[str, Any] | None = None,
        **values: Any,
    ) -> ServoArm:
        """A driver for all servos of an emulator."""
        context = ActuatorContext(ActuatorFacts(**(facts or {})), remembered=remembered or {})
        return self.actuator(self.settings_type.model_validate(self.settings_of(emulator, **values)), context)

    def target(self, emulator: EmulatedBus, **values: Any) -> ServoCalibrationTarget:
        """What calibrates the servos of an emulator, patient with its bus."""
        target = self.driver(emulator, calibrated=False, **values).calibration_target()
        assert isinstance(target, ServoCalibrationTarget)
        patient(target._bus)
        return target

    @contextmanager
    def open_tools(self, emulator: EmulatedBus) -> Iterator[ServoBusTools]:
        """Bus tools on an open port of an emulator."""
        port = SerialPort(Endpoint(emulator.port, device_root=str(emulator.root)), 1_000_000)
        port.open()
        try:
            yield self.tools(port)
        finally:
            port.close()

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


def energised(emulator: EmulatedBus) -> set[bool]:
    """Whether the servos of an emulator have torque: {True}, {False} or both."""
    return {servo["energised"] for servo in emulator.servos()}


def drive_to(arm: ServoArm, pose: Any, timeout_s: float = 60.0) -> None:
    """Commands a pose until the joints are there."""
    deadline_s = time.monotonic() + timeout_s
    while np.abs(arm.read().position_rad - pose).max() > 0.005:
        assert time.monotonic() < deadline_s
        arm.write(pose)


STS3215_KIND = Kind(
    package="joshua_sts3215",
    protocol="feetech",
    arm="so_arm100",
    family=STS3215,
    bus=Sts3215Bus,
    actuator=Sts3215Actuator,
    settings_type=Sts3215Settings,
    stop_request=Sts3215StopRequest,
    tools=Sts3215BusTools,
    slow={"velocity_ticks_s": 200},
    paced=({"velocity_ticks_s": 1500, "acceleration": 50}, {"goal_speed": 1500, "acceleration": 50}),
    offset_sign=1,
    other_baudrate=115_200,
    is_slow_to_scan=False,
)
DYNAMIXEL_KIND = Kind(
    package="joshua_dynamixel",
    protocol="dynamixel",
    arm="koch",
    family=X_SERIES,
    bus=DynamixelBus,
    actuator=DynamixelActuator,
    settings_type=DynamixelSettings,
    stop_request=DynamixelStopRequest,
    tools=DynamixelBusTools,
    slow={"velocity": 13},
    paced=({"velocity": 100, "acceleration": 50}, {"profile_velocity": 100, "profile_acceleration": 50}),
    offset_sign=-1,
    other_baudrate=57_600,
    is_slow_to_scan=True,
    settings={"models": ["xl330-m077"]},
)
KINDS = (STS3215_KIND, DYNAMIXEL_KIND)

"""Settings of the driver, made from a ``spike_motor_config`` block and the plan's calibration."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Annotated, Any

from google.protobuf.message import Message
from joshua.api import ActuatorSettings, BlockContext, FieldError, FromField, JointRange
from joshua.api.calibration import ArmCalibration, MotorCalibration
from pydantic import Field, model_validator
from typing_extensions import Self

PORTS = "ABCDEF"
SERVICE = "c5f50001-8280-46da-89f4-6d8051e4aeef"
TICKS_PER_TURN = 4096  # ticks of a calibration; the motor itself counts degrees
MIDDLE_TICK = 2048
#: Transports that bumble supports, the most common first.
TRANSPORTS = (
    *("tcp-client", "serial", "usb", "hci-socket", "vhci", "pyusb", "pty", "unix", "ws-client", "udp"),
    *("tcp-server", "ws-server", "file", "android-netsim", "android-emulator"),
)
_SYSTEM_ADAPTER = re.compile(r"hci\d+")


class SpikeSettings(ActuatorSettings):
    """Settings of the driver.

    Attributes:
        adapter: "" for the system's default, ``hci1`` for another one of the system, or a transport of
            bumble such as ``tcp-client:127.0.0.1:4711``.
        port_names: letters of the hub's ports, in joint order.
        calibration: None if the motors are not calibrated; a motor id is the position of its port, A is 1.
    """

    device_name: Annotated[str, FromField("comm.ble.device_name")]
    service_uuid: Annotated[str, FromField("comm.ble.service_uuid")] = SERVICE
    adapter: Annotated[str, FromField("comm.ble.adapter")] = ""
    port_names: tuple[str, ...] = Field(min_length=1, max_length=len(PORTS))
    calibration: ArmCalibration | None = None

    @classmethod
    def si_values(
        cls, values: Mapping[str, Any], node: Message | None, context: BlockContext
    ) -> dict[str, Any]:
        """Add the calibration of the motors; an empty service means Pybricks' own."""
        result = super().si_values(values, node, context)
        if not result.get("service_uuid"):
            result["service_uuid"] = SERVICE
        if context.calibration is not None:
            result["calibration"] = ArmCalibration.values_of(context.calibration)
        return result

    @model_validator(mode="after")
    def _names_an_adapter(self) -> Self:
        kind, colon, _ = self.adapter.partition(":")
        if not self.adapter or (not colon and _SYSTEM_ADAPTER.fullmatch(self.adapter)):
            return self
        if not colon or kind not in TRANSPORTS:
            raise FieldError(
                "comm.ble.adapter",
                f"{self.adapter!r} is neither an adapter of the system nor a transport of bumble",
                allowed=("hci0", "tcp-client:127.0.0.1:4711", *(f"{name}:…" for name in TRANSPORTS[1:])),
                remedy="omit adapter to use the system's own",
            )
        return self

    @model_validator(mode="after")
    def _speaks_pybricks(self) -> Self:
        if self.service_uuid.lower() != SERVICE:
            raise FieldError(
                "comm.ble.service_uuid",
                "the driver supports only the service of the Pybricks firmware",
                allowed=(f'"{SERVICE}"',),
                remedy="remove service_uuid",
            )
        return self

    @model_validator(mode="after")
    def _names_ports_once(self) -> Self:
        for port in self.port_names:
            if self.port_names.count(port) > 1:
                free = [letter for letter in PORTS if letter not in self.port_names]
                raise FieldError(
                    "port_names",
                    f"port {port} is listed twice; each port has one motor",
                    allowed=tuple(free),
                    remedy="name each port once",
                )
        return self

    @model_validator(mode="after")
    def _fits_its_calibration(self) -> Self:
        if self.calibration is None:
            return self
        absent = [port for port in self.port_names if self.calibration.motor(port_id(port)) is None]
        if absent:
            known = [PORTS[motor.id - 1] for motor in self.calibration.motors if 1 <= motor.id <= len(PORTS)]
            raise FieldError(
                "port_names",
                f"the calibration of this hub has no motor on port {', '.join(absent)}",
                allowed=tuple(known),
                remedy="calibrate with all motors, or correct port_names",
            )
        return self

    def motor(self, port: str) -> MotorCalibration | None:
        """Return the calibration of the motor on a port."""
        return self.calibration.motor(port_id(port)) if self.calibration is not None else None

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Return the joint names in the order of port_names: from the calibration, else ``joint_<port>``."""
        motors = [(port, self.motor(port)) for port in self.port_names]
        return tuple(motor.joint_name if motor else f"joint_{port.lower()}" for port, motor in motors)

    def joints(self) -> tuple[JointRange, ...]:
        """Joints, known without a connection."""
        named = zip(self.port_names, self.joint_names, strict=True)
        return tuple(JointRange(name, *self.range_rad(port)) for port, name in named)

    def range_rad(self, port: str) -> tuple[float, float]:
        """Return the range of a joint: the calibrated one, else half a turn to both sides of the mark."""
        motor = self.motor(port)
        if motor is None:
            return -math.pi, math.pi
        low, high = (
            (tick - MIDDLE_TICK) * math.tau / TICKS_PER_TURN for tick in (motor.range_min, motor.range_max)
        )
        return (-high, -low) if motor.inverted else (low, high)


def port_id(port: str) -> int:
    """Return the motor id of a port in a calibration."""
    return PORTS.index(port) + 1

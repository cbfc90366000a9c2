"""Settings of a laser scanner."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any

from google.protobuf.message import Message
from joshua.plugins.settings import BlockSettings, FieldError, FromField
from pydantic import model_validator
from typing_extensions import Self

from joshua_lidar.models import EXPRESS, MODELS

#: How much more than a turn the window may be, for angles that were rounded up.
_ROUNDING_RAD = 1e-3


class LidarSettings(BlockSettings):
    """Settings of a laser scanner.

    Attributes:
        port, serial_number, vid_pid, baudrate: of the serial link.
        angle_min_rad, angle_max_rad: the window that is published, counter-clockwise positive (REP 103).
        range_min_m, range_max_m: distances that count as measurements.
        display: shows the scan in a window.
        model: name of the model; "" where it is to be found out.
        scan_mode: of an RPLIDAR.
        device_root: folder that holds ``dev`` and ``sys``.
    """

    port: Annotated[str, FromField("comm.serial.port")] = ""
    serial_number: Annotated[str, FromField("comm.serial.serial_number")] = ""
    vid_pid: Annotated[str, FromField("comm.serial.vid_pid")] = ""
    baudrate: Annotated[int, FromField("comm.serial.baudrate")] = 115_200
    angle_min_rad: Annotated[float, FromField("angle_min")]
    angle_max_rad: Annotated[float, FromField("angle_max")]
    range_min_m: Annotated[float, FromField("range_min")]
    range_max_m: Annotated[float, FromField("range_max")]
    display: bool = False
    model: str = ""
    scan_mode: str = EXPRESS
    device_root: str = "/"

    @classmethod
    def si_values(
        cls, values: Mapping[str, Any], node: Message | None, context: Mapping[str, Any]
    ) -> dict[str, Any]:
        """Adds the place of emulated devices from the plan's context."""
        result = super().si_values(values, node, context)
        if context.get("device_root"):
            result["device_root"] = context["device_root"]
        return result

    @model_validator(mode="after")
    def _names_a_port(self) -> Self:
        if not (self.port or self.serial_number or self.vid_pid):
            raise FieldError(
                "comm",
                "a laser scanner needs a serial port, by its path or by its adapter's identity",
                allowed=("serial { port: … }", "serial { serial_number: … }", "serial { vid_pid: … }"),
                remedy="add comm { serial { … } }; joshua find-port lists the ports",
            )
        return self

    @model_validator(mode="after")
    def _has_a_window(self) -> Self:
        width = self.angle_max_rad - self.angle_min_rad
        if width > math.tau + _ROUNDING_RAD:
            raise FieldError(
                "angle_max",
                f"the window from angle_min to angle_max is {width:.4g} rad wide, more than a turn",
                allowed=(f"at most {self.angle_min_rad + math.tau:.4f} rad",),
                remedy="set angle_min: -3.1415 angle_max: 3.1415 for the whole turn",
            )
        if not width > 0:
            raise FieldError(
                "angle_max",
                "angle_max is not above angle_min, so that the scan has no width",
                allowed=("more than angle_min",),
                remedy="set angle_max above angle_min",
            )
        if not self.range_min_m < self.range_max_m:
            raise FieldError(
                "range_max",
                "range_max is not above range_min, so that nothing can be measured",
                allowed=("more than range_min",),
                remedy="set range_max above range_min",
            )
        return self

    @model_validator(mode="after")
    def _suits_the_model(self) -> Self:
        model = MODELS.get(self.model)
        if model is None:
            return self
        if self.baudrate != model.baudrate:
            raise FieldError(
                "comm.serial.baudrate",
                f"the {model.title} talks at {model.baudrate} bit/s only",
                allowed=(str(model.baudrate),),
                remedy=f"set baudrate: {model.baudrate}, or correct model",
            )
        if self.scan_mode != EXPRESS and model.family != "rplidar":
            raise FieldError(
                "scan_mode",
                f"the {model.title} has one way to send its measurements; scan_mode would have no effect",
                allowed=("omitted",),
                remedy="remove scan_mode",
            )
        return self

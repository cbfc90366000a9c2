"""Settings of a laser scanner."""

from __future__ import annotations

import math
from typing import Annotated

from joshua.api import FieldError, FromField
from joshua_serial.settings import SerialSettings
from pydantic import model_validator
from typing_extensions import Self

from joshua_lidar.models import EXPRESS, MODELS

#: Tolerance by which the window may exceed a turn, for rounded angles.
_ROUNDING_RAD = 1e-3


class LidarSettings(SerialSettings):
    """Settings of a laser scanner.

    Attributes:
        angle_min_rad, angle_max_rad: the window that is published, counter-clockwise positive (REP 103).
        range_min_m, range_max_m: distances that count as measurements.
        display: show the scans in a window.
        model: name of the model; "" to detect it.
        scan_mode: of an RPLIDAR.
    """

    angle_min_rad: Annotated[float, FromField("angle_min")]
    angle_max_rad: Annotated[float, FromField("angle_max")]
    range_min_m: Annotated[float, FromField("range_min")]
    range_max_m: Annotated[float, FromField("range_max")]
    display: bool = False
    model: str = ""
    scan_mode: str = EXPRESS

    @classmethod
    def called(cls) -> str:
        """Name of the device in messages."""
        return "a laser scanner"

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
                "angle_max is not above angle_min, so the scan has no width",
                allowed=("more than angle_min",),
                remedy="set angle_max above angle_min",
            )
        if not self.range_min_m < self.range_max_m:
            raise FieldError(
                "range_max",
                "range_max is not above range_min, so the scanner can measure nothing",
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
                f"the {model.title} runs at {model.baudrate} bit/s only",
                allowed=(str(model.baudrate),),
                remedy=f"set baudrate: {model.baudrate}, or correct model",
            )
        if self.scan_mode != EXPRESS and model.family != "rplidar":
            raise FieldError(
                "scan_mode",
                f"the {model.title} has only one scan mode, so scan_mode has no effect",
                allowed=("omitted",),
                remedy="remove scan_mode",
            )
        return self

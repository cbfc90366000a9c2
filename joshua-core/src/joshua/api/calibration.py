"""Calibrations of arms as values, and the conversion of ticks to radians."""

from typing import TYPE_CHECKING

from joshua.devices.units import TICKS_PER_TURN as TICKS_PER_TURN
from joshua.devices.units import rad_to_ticks as rad_to_ticks
from joshua.devices.units import ticks_to_rad as ticks_to_rad
from joshua.plan.lazy import lazy_names

if TYPE_CHECKING:
    from joshua.devices.calibration import LARGEST_OFFSET as LARGEST_OFFSET
    from joshua.devices.calibration import ArmCalibration as ArmCalibration
    from joshua.devices.calibration import MotorCalibration as MotorCalibration

#: Loaded at first use: building the models takes milliseconds, which a driver that only converts does not
#: need.
_MODELS = ("LARGEST_OFFSET", "ArmCalibration", "MotorCalibration")
__getattr__, __dir__ = lazy_names(__name__, {"joshua.devices.calibration": _MODELS})

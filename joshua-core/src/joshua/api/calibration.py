"""Calibrations of arms as values, and what turns ticks into radians."""

from joshua.devices.calibration import LARGEST_OFFSET as LARGEST_OFFSET
from joshua.devices.calibration import ArmCalibration as ArmCalibration
from joshua.devices.calibration import MotorCalibration as MotorCalibration
from joshua.devices.units import TICKS_PER_TURN as TICKS_PER_TURN
from joshua.devices.units import rad_to_ticks as rad_to_ticks
from joshua.devices.units import ticks_to_rad as ticks_to_rad

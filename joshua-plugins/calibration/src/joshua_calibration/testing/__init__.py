"""The conformance check of a ``CalibrationTarget``, for plugins that bring one."""

from joshua_calibration.testing.check import check_calibration_target

__all__ = ["check_calibration_target"]

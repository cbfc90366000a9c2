"""Calibration on the command line: running it, comparing, recovering, exchanging with LeRobot."""

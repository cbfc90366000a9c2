"""Calibration of arms by hand: procedure, front ends, and transactional storage of the result."""

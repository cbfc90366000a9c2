"""Devices: base classes of actuators and sensors, their node behaviours, and the mock devices."""

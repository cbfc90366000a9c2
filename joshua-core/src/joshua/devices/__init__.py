"""Devices: base classes of actuators and sensors, and their node behaviours."""

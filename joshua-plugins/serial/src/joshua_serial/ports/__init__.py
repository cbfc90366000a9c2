"""Shared parts of the serial port commands: find ports, their users, and the motors that reply there."""

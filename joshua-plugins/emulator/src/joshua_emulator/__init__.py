"""Emulated robot hardware that speaks the real protocols: servo buses and
laser scanners on pseudo-terminals, cameras over HTTP.

A driver under test opens the emulator's port like any serial port, or its address like that of any network
camera; nothing of the emulator is imported by drivers, and it imports nothing of theirs, so a mistake in
either shows.
"""

from joshua_emulator.camera.process import EmulatedCamera
from joshua_emulator.emulator_process import EmulatorError, EmulatorProcess
from joshua_emulator.encoder.process import EmulatedEncoder
from joshua_emulator.gamepad.process import EmulatedGamepad
from joshua_emulator.lidar.process import EmulatedLidar
from joshua_emulator.process import EmulatedBus

__all__ = [
    "EmulatedBus",
    "EmulatedCamera",
    "EmulatedEncoder",
    "EmulatedGamepad",
    "EmulatedLidar",
    "EmulatorError",
    "EmulatorProcess",
]

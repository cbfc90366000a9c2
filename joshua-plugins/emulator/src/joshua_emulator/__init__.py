"""Emulated robot hardware that speaks the real protocols: servo buses and
laser scanners on pseudo-terminals, cameras over HTTP.

A driver under test opens the emulator's port like any serial port, or its address like that of any network
camera. Drivers and emulators share no code, so a mistake in either becomes visible.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
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

# Loaded on first use: checking a file only needs to know what this package provides.
_MODULE_OF = {
    "EmulatedBus": "joshua_emulator.process",
    "EmulatedCamera": "joshua_emulator.camera.process",
    "EmulatedEncoder": "joshua_emulator.encoder.process",
    "EmulatedGamepad": "joshua_emulator.gamepad.process",
    "EmulatedLidar": "joshua_emulator.lidar.process",
    "EmulatorError": "joshua_emulator.emulator_process",
    "EmulatorProcess": "joshua_emulator.emulator_process",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_MODULE_OF[name]), name)

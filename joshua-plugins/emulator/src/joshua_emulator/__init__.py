"""Emulated robot hardware that speaks the real bus protocols on pseudo-terminals.

A driver under test opens the emulator's port like any serial port; nothing of the emulator is imported by
drivers, and it imports nothing of theirs, so a mistake in either shows.
"""

from joshua_emulator.process import EmulatedBus, EmulatorError

__all__ = ["EmulatedBus", "EmulatorError"]

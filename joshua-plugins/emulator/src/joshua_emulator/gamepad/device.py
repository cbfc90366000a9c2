"""The gamepad that ``--emulate`` substitutes for that of a file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from google.protobuf.message import Message

from joshua_emulator.devices import ProcessEmulator
from joshua_emulator.gamepad.process import EmulatedGamepad


class GamepadEmulator(ProcessEmulator):
    """A gamepad behind a UNIX socket, moved in place of the user."""

    def make_process(self, block: Any, folder: Path) -> EmulatedGamepad:
        """Return the gamepad, which stores nothing."""
        del block, folder
        return EmulatedGamepad(motion="demonstration", fault=list(self.device.faults))

    def amend(self, block: Message) -> None:
        """Replace the device with the socket."""
        block.device = self._process.device  # type: ignore[attr-defined]

    @property
    def endpoint(self) -> str:
        """Path of the socket."""
        return str(self._process.device)

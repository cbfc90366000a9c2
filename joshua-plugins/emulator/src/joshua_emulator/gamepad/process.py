"""A handle on an emulated gamepad."""

from __future__ import annotations

from typing import Any

from joshua_emulator.emulator_process import EmulatorProcess


class EmulatedGamepad(EmulatorProcess):
    """An emulator process with one gamepad; a context manager. It ends with the process that started it.

    Args:
        rate: reports per second.
        options: further options of the command line by name, such as ``motion="demonstration"``.
    """

    def __init__(self, rate: float = 125, **options: Any) -> None:
        super().__init__(("gamepad", "--rate", str(rate)), options)

    @property
    def device(self) -> str:
        """Path of the socket, for ``GamepadConfig.device``."""
        return str(self.ready["device"])

    def set(self, **values: float) -> None:
        """Move axes and buttons by name: -1 to 1, right and up positive."""
        self.ask("set", values=values)

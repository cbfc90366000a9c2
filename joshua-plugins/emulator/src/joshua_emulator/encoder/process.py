"""A handle on emulated encoders."""

from __future__ import annotations

from typing import Any

from joshua_emulator.emulator_process import EmulatorProcess


class EmulatedEncoder(EmulatorProcess):
    """An emulator process with encoders on one link; a context manager. It ends with whoever started it.

    Args:
        kind: line, as5600 or amt21.
        options: further options of the command line by name, such as ``resolution=16384``,
            ``addresses=[84, 88]``, ``crc=True``, ``fault=["silent,at_s=2"]``.
    """

    def __init__(self, kind: str = "line", **options: Any) -> None:
        super().__init__(("encoder", "--kind", kind), options)

    @property
    def port(self) -> str:
        """Path of the serial port as it was at the start."""
        return str(self.ready["port"])

    @property
    def by_id(self) -> str:
        """Path by the adapter's identity, which outlives a replug under another name."""
        return str(self.ready["by_id"])

    def angle_rad(self, monotonic_ns: int) -> float:
        """The truth: angle of the shaft at a time of the monotonic clock."""
        return float(self.ask("angle", t_ns=monotonic_ns)["angle_rad"])

"""A handle on an emulated laser scanner."""

from __future__ import annotations

from typing import Any

from joshua_emulator.emulator_process import EmulatorProcess


class EmulatedLidar(EmulatorProcess):
    """An emulator process with one scanner; a context manager. The process ends with the one that started it.

    Args:
        model: as in ``LidarConfig.model``.
        options: further options of the command line by name, such as ``fault=["stall,at_s=2"]``.
    """

    def __init__(self, model: str = "rplidar_a1", **options: Any) -> None:
        super().__init__(("lidar", "--model", model), options)

    @property
    def port(self) -> str:
        """Path of the serial port as it was at the start."""
        return str(self.ready["port"])

    @property
    def by_id(self) -> str:
        """Path by the adapter's identity, which outlives a replug under another name."""
        return str(self.ready["by_id"])

    def state(self) -> dict[str, Any]:
        """The true state of the scanner: motor, scanning, turns per second and so on."""
        return self.ask("state")

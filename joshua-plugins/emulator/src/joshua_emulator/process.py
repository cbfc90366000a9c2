"""A handle on an emulated servo bus."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from joshua_emulator.emulator_process import EmulatorError, EmulatorProcess

__all__ = ["EmulatedBus", "EmulatorError"]


class EmulatedBus(EmulatorProcess):
    """An emulator process with one bus; a context manager. The process ends with the one that started it.

    Args:
        protocol: ``feetech``.
        ids: bus ids in cable order; options: further options of the command line by name, such as
            ``arm="so_arm100"``, ``calibrated=True``, ``fault=["drop=0.01"]``.
    """

    def __init__(
        self, protocol: str = "feetech", ids: Sequence[int] = (1, 2, 3, 4, 5, 6), **options: Any
    ) -> None:
        super().__init__((protocol, "--ids", ",".join(str(i) for i in ids)), options)

    @property
    def port(self) -> str:
        """Path of the serial port as it was at the start."""
        return str(self.ready["port"])

    @property
    def by_id(self) -> str:
        """Path by the adapter's identity, which outlives a replug under another name."""
        return str(self.ready["by_id"])

    def servo(self, servo_id: int) -> dict[str, Any]:
        """The true state of one servo: position, torque, temperature and so on."""
        return dict(self.ask("state", id=servo_id)["servos"][0])

    def servos(self) -> list[dict[str, Any]]:
        """The true state of all servos in cable order."""
        return list(self.ask("state")["servos"])

    def calibration(self) -> dict[str, Any]:
        """Calibration of the arm as its EEPROM holds it, in the fields of an ``ArmCalibration``."""
        return dict(self.ask("calibration")["calibration"])

    def hand(self, positions: Mapping[int, float], *, duration_s: float = 0.0) -> None:
        """Move joints without torque by hand: ticks by servo id."""
        for servo_id, ticks in positions.items():
            self.ask("hand", id=servo_id, ticks=ticks, duration_s=duration_s)

    def guide(self, slot: int | None, seconds: float) -> None:
        """Move one joint through its range, or all to their middles, as a calibration asks a person to."""
        self.ask("guide", seconds=seconds, **({} if slot is None else {"slot": slot}))

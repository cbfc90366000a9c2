"""A handle on an emulated hub."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from joshua_emulator.emulator_process import EmulatorProcess


class EmulatedHub(EmulatorProcess):
    """An emulator process with one hub; a context manager. The process ends with the one that started it.

    Args:
        ports: letters of the ports with motors.
        options: further options of the command line by name, such as ``name="Pybricks Hub"``,
            ``fault=["unplug,at_s=2"]``.
    """

    def __init__(self, ports: Sequence[str] = ("A", "B"), **options: Any) -> None:
        super().__init__(("spike", "--ports", ",".join(ports)), options)

    @property
    def adapter(self) -> str:
        """The Bluetooth adapter through which the hub is reached, for ``BLE.adapter``."""
        return str(self.ready["adapter"])

    @property
    def address(self) -> str:
        """The hub's Bluetooth address, which follows from its name."""
        return str(self.ready["address"])

    def state(self) -> dict[str, Any]:
        """The true state of the hub: whether its program runs, who is connected, its motors."""
        return self.ask("state")

    def motor(self, port: str) -> dict[str, Any]:
        """The true state of one motor."""
        return dict(self.state()["motors"][port])

    def guide(self, slot: int | None, seconds: float) -> None:
        """Move the shafts by hand as a calibration asks: one through its range, or all to their middles."""
        self.ask("guide", seconds=seconds, **({} if slot is None else {"slot": slot}))

    def hand(self, port: str, absolute_deg: float) -> None:
        """Turn a shaft without torque by hand, to an angle against its mark."""
        self.ask("hand", port=port, absolute_deg=absolute_deg)

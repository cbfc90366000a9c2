"""Emulators of serial sensors that ``--emulate`` substitutes for a file's devices."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from google.protobuf.message import Message

from joshua_emulator.devices import ProcessEmulator
from joshua_emulator.encoder.process import EmulatedEncoder
from joshua_emulator.lidar.models import MODELS
from joshua_emulator.lidar.process import EmulatedLidar

if TYPE_CHECKING:
    from pathlib import Path

#: Default scanner for a block without a model, by line speed.
_SCANNERS = {128_000: "ydlidar_x4", 230_400: "ld19", 460_800: "rplidar_c1"}
_USUAL_SCANNER = "rplidar_a1"


class SerialSensorEmulator(ProcessEmulator):
    """A sensor on a pseudo-terminal."""

    def amend(self, block: Message) -> None:
        """Replace the serial port with the pseudo-terminal."""
        serial: Any = block.comm.serial  # type: ignore[attr-defined]
        for field in ("serial_number", "vid_pid"):
            serial.ClearField(field)
        serial.port = self._process.by_id

    @property
    def endpoint(self) -> str:
        """Path of the pseudo-terminal."""
        return str(self._process.port)


class LidarEmulator(SerialSensorEmulator):
    """A laser scanner in a room."""

    def make_process(self, block: Any, folder: Path) -> EmulatedLidar:
        """Return a scanner of the block's model, else a default one with the block's line speed."""
        del folder  # a scanner stores nothing
        usual = _SCANNERS.get(block.comm.serial.baudrate, _USUAL_SCANNER)
        model = block.model if block.model in MODELS else usual
        return EmulatedLidar(model, identity=self.device.node_name, fault=list(self.device.faults))


class EncoderEmulator(SerialSensorEmulator):
    """Rotary encoders on a shaft that turns back and forth."""

    def make_process(self, block: Any, folder: Path) -> EmulatedEncoder:
        """Make the encoders with protocol, resolution, line speed and addresses of the block."""
        del folder  # an encoder stores nothing
        return EmulatedEncoder(
            block.protocol or "line",
            resolution=block.resolution,
            baudrate=block.comm.serial.baudrate,
            addresses=list(block.address) or None,
            counter_range=block.counter_range or None,
            identity=self.device.node_name,
            fault=list(self.device.faults),
        )

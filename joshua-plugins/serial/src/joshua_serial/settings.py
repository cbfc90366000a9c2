"""Settings that every device with a serial link has."""

from __future__ import annotations

from typing import Annotated

from joshua.api import BlockSettings, FieldError, FromField
from pydantic import model_validator
from typing_extensions import Self


class SerialSettings(BlockSettings):
    """Settings of a device with a serial link.

    Attributes:
        port, serial_number, vid_pid, baudrate: of the serial link.
        device_root: folder that contains ``dev`` and ``sys``; an emulated device has its own.
    """

    port: Annotated[str, FromField("comm.serial.port")] = ""
    serial_number: Annotated[str, FromField("comm.serial.serial_number")] = ""
    vid_pid: Annotated[str, FromField("comm.serial.vid_pid")] = ""
    baudrate: Annotated[int, FromField("comm.serial.baudrate")] = 115_200
    device_root: str = "/"

    @classmethod
    def called(cls) -> str:
        """Name of the device in messages, such as "a laser scanner"."""
        raise NotImplementedError(f"{cls.__name__} has no name for messages: override called")

    @model_validator(mode="after")
    def _names_a_port(self) -> Self:
        if not (self.port or self.serial_number or self.vid_pid):
            raise FieldError(
                "comm",
                f"{self.called()} needs a serial port, by its path or by its adapter's identity",
                allowed=("serial { port: … }", "serial { serial_number: … }", "serial { vid_pid: … }"),
                remedy="add comm { serial { … } }; joshua find-port lists the ports",
            )
        return self

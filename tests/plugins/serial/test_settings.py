"""Settings that every device with a serial link has."""

from __future__ import annotations

import pytest
from joshua.plugins.settings import FieldError
from joshua.schema.config_pb2 import LidarConfig
from joshua_serial.settings import SerialSettings
from pydantic import ValidationError


class Scale(SerialSettings):
    @classmethod
    def called(cls) -> str:
        return "a scale"


def test_link_comes_from_the_block() -> None:
    block = LidarConfig()
    block.comm.serial.vid_pid = "10c4:ea60"
    block.comm.serial.baudrate = 9600
    found = Scale.from_block(block)
    assert (found.port, found.vid_pid, found.baudrate) == ("", "10c4:ea60", 9600)
    assert found.device_root == "/"


def test_link_without_a_port_is_refused() -> None:
    with pytest.raises(ValidationError) as caught:
        Scale()
    (detail,) = caught.value.errors()
    error = detail["ctx"]["error"]
    assert isinstance(error, FieldError)
    assert str(error) == "a scale needs a serial port, by its path or by its adapter's identity"
    assert (error.field, error.allowed[0]) == ("comm", "serial { port: … }")
    assert error.remedy == "add comm { serial { … } }; joshua find-port lists the ports"

"""Settings of encoders in tests, made as the plan makes them from a block."""

from __future__ import annotations

from typing import Any

from joshua.schema import config_pb2
from joshua_encoder.settings import EncoderSettings


def make_settings(port: str, protocol: str = "", baudrate: int = 115_200, **fields: Any) -> EncoderSettings:
    """Settings of an encoder of 4096 counts, but for the fields that are given."""
    block = config_pb2.EncoderConfig(**{"resolution": 4096, "protocol": protocol, **fields})
    block.comm.serial.port = port
    block.comm.serial.baudrate = baudrate
    return EncoderSettings.from_block(block)

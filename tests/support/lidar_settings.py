"""Settings of laser scanners in tests, made as the plan makes them from a block."""

from __future__ import annotations

from typing import Any

from joshua.schema import config_pb2
from joshua_lidar.models import MODELS
from joshua_lidar.settings import LidarSettings


def make_settings(port: str, model: str = "", baudrate: int = 0, **fields: Any) -> LidarSettings:
    """Settings of a scanner of the whole turn and 12 m, at its own line speed unless another one is given."""
    rate = baudrate or (MODELS[model].baudrate if model else 115_200)
    values = {"angle_min": -3.1415, "angle_max": 3.1415, "range_min": 0.1, "range_max": 12.0, "model": model}
    block = config_pb2.LidarConfig(**{**values, **fields})
    block.comm.serial.port = port
    block.comm.serial.baudrate = rate
    return LidarSettings.from_block(block)

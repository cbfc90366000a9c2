"""Settings of cameras in tests, made as the plan makes them from a block."""

from __future__ import annotations

from typing import Any

from joshua.schema import config_pb2
from joshua_camera.settings import CameraSettings

WIDTH, HEIGHT, FPS = 320, 240, 60


def make_settings(publishes: tuple[str, ...] = (), **fields: Any) -> CameraSettings:
    """Settings of a camera of 320 × 240 at 60 Hz, but for the fields that are given."""
    block = config_pb2.CameraConfig(**{"width": WIDTH, "height": HEIGHT, "fps": FPS, **fields})
    return CameraSettings.from_block(block).model_copy(update={"publishes": publishes})

"""Settings of a camera."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import Any
from urllib.parse import urlsplit

from google.protobuf.message import Message
from joshua.api import BlockContext, BlockSettings, FieldError
from joshua.api.schema import TYPE_NAMES
from pydantic import model_validator

from joshua_camera.source_text import SourceKind, scheme, source_kind

SCHEMES = ("http", "https", "rtsp", "rtsps", "rtmp", "rtp", "tcp", "udp")


class CameraSettings(BlockSettings):
    """Settings of a camera.

    Attributes:
        device_id: N of /dev/videoN; has no effect beside a source.
        width, height: of the picture, in pixels; fps: frames per second that are asked for.
        pixel_format: four-character code that a device is asked for.
        brightness, contrast, saturation, exposure: in the driver's own scale; None leaves them as they are.
        source: device, address or files in place of ``device_id``; "" for none.
        intrinsics_file: calibration for CameraInfo; "" for none.
        display: shows the pictures in a window.
        publishes: ROS 2 types that the node publishes; empty where no node is known, which means all.
    """

    device_id: int
    width: int
    height: int
    fps: int
    pixel_format: str
    brightness: int | None = None
    contrast: int | None = None
    saturation: int | None = None
    exposure: int | None = None
    source: str
    intrinsics_file: str
    display: bool
    publishes: tuple[str, ...] = ()

    @classmethod
    def si_values(
        cls, values: Mapping[str, Any], node: Message | None, context: BlockContext
    ) -> dict[str, Any]:
        """Add what the node publishes."""
        numbers = [publisher.data_type for publisher in getattr(node, "publishers", ())]
        known = tuple(TYPE_NAMES[number] for number in numbers if number in TYPE_NAMES)
        return super().si_values(values, node, context) | {"publishes": known}

    @model_validator(mode="after")
    def _check_address(self) -> CameraSettings:
        if not self.source or source_kind(self.source) is not SourceKind.ADDRESS:
            return self
        found = scheme(self.source)
        if found not in SCHEMES:
            near = difflib.get_close_matches(found, SCHEMES, n=1, cutoff=0.5)
            raise FieldError(
                "source",
                f"{found}:// is not a supported camera address",
                allowed=tuple(f"{name}://" for name in dict.fromkeys((*near, *SCHEMES))),
                remedy="copy the stream's address from the camera's or the phone's page",
            )
        if not _names_a_host(self.source):
            raise FieldError(
                "source",
                "the address lacks a host or has an invalid port",
                allowed=("http://HOST:PORT/PATH",),
                remedy="copy the stream's address from the camera's or the phone's page",
            )
        return self


def _names_a_host(address: str) -> bool:
    try:
        parts = urlsplit(address)
        return bool(parts.hostname) and parts.port != 0
    except ValueError:  # a port that is no number, or out of range
        return False

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
        device_id: N of /dev/videoN; has no effect if a source is set.
        width, height: of the picture, in pixels; fps: requested frames per second.
        pixel_format: requested four-character code.
        brightness, contrast, saturation, exposure: in the driver's scale; None leaves them unchanged.
        source: device, address or files instead of ``device_id``; "" for none.
        intrinsics_file: calibration for CameraInfo; "" for none.
        display: shows the pictures in a window.
        publishes: ROS 2 types that the node publishes; empty (no node) means all.
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
        """Add the types that the node publishes."""
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
    except ValueError:  # a port that is not a number, or out of range
        return False

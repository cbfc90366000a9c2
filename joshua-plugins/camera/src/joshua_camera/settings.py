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

#: Bits of one pixel by format, for cameras that send pictures as they are.
BITS_PER_PIXEL = {
    **dict.fromkeys(("YUYV", "YUY2", "UYVY", "YVYU", "VYUY", "RGBP"), 16),
    **dict.fromkeys(("NV12", "NV21", "YU12", "YV12", "I420"), 12),
    **dict.fromkeys(("RGB3", "BGR3"), 24),
    "GREY": 8,
}

#: What one camera can send over USB 2.0: three packets of 1024 bytes in each of 8000 microframes a second.
#: Source: USB 2.0 specification, 5.9.1.
USB2_MBIT_S = 3 * 1024 * 8 * 8000 / 1e6

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

    def warnings(self) -> tuple[FieldError, ...]:
        """Name a stream that does not fit through USB 2.0."""
        bits = BITS_PER_PIXEL.get(self.pixel_format.upper(), 0)
        is_device = not self.source or source_kind(self.source) is SourceKind.DEVICE
        rate_mbit_s = self.width * self.height * self.fps * bits / 1e6
        if not is_device or rate_mbit_s <= USB2_MBIT_S:
            return ()
        return (
            FieldError(
                "pixel_format",
                f"{self.width} × {self.height} pixels of {self.pixel_format} at {self.fps} Hz are "
                f"{rate_mbit_s:.0f} Mbit/s, but USB 2.0 carries at most {USB2_MBIT_S:.0f} Mbit/s of a camera",
                allowed=('"MJPG"',),
                remedy='Write pixel_format: "MJPG", or reduce width, height or fps. A USB 3 camera needs a '
                "USB 3 socket",
                code="usb-bandwidth",
            ),
        )

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

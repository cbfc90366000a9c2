"""The ioctls of Video4Linux2 for listing video devices.

Source: linux/videodev2.h of the kernel's user-space interface.
"""

from __future__ import annotations

import errno
import fcntl
import os
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

_CAPTURE = 1  # V4L2_BUF_TYPE_VIDEO_CAPTURE
_MMAP = 1  # V4L2_MEMORY_MMAP
_DISCRETE = 1
_CAP_VIDEO_CAPTURE = 0x00000001
_CAP_STREAMING = 0x04000000
_CAP_DEVICE_CAPS = 0x80000000
_MOST_ENTRIES = 256  # a broken driver may accept every index


def _code(direction: int, number: int, size: int) -> int:
    return direction << 30 | size << 16 | ord("V") << 8 | number


_READ, _WRITE = 2, 1
QUERYCAP = _code(_READ, 0, 104)
ENUM_FMT = _code(_READ | _WRITE, 2, 64)
REQBUFS = _code(_READ | _WRITE, 8, 20)
STREAMOFF = _code(_WRITE, 19, 4)
QUERYCTRL = _code(_READ | _WRITE, 36, 68)
ENUM_FRAMESIZES = _code(_READ | _WRITE, 74, 44)
ENUM_FRAMEINTERVALS = _code(_READ | _WRITE, 75, 52)

CID_BRIGHTNESS = 0x00980900
CID_CONTRAST = 0x00980901
CID_SATURATION = 0x00980902
CID_EXPOSURE_ABSOLUTE = 0x009A0902


@dataclass(frozen=True)
class Capability:
    """Identity of a device.

    Attributes:
        driver: such as ``uvcvideo``; card: device name; bus_info: USB path.
        captures: whether it delivers pictures; the second node of UVC cameras delivers only metadata.
    """

    driver: str
    card: str
    bus_info: str
    captures: bool


@dataclass(frozen=True)
class FrameSize:
    """A picture size of one format, with its rates in Hz, highest first."""

    width: int
    height: int
    rates_hz: tuple[float, ...]


@dataclass(frozen=True)
class PixelFormat:
    """A format of a device: four-character code, name and sizes."""

    code: str
    name: str
    sizes: tuple[FrameSize, ...]


@dataclass(frozen=True)
class ControlRange:
    """Allowed range of a control."""

    minimum: int
    maximum: int
    step: int
    default: int


class VideoDevice:
    """An open video device; use ``open_device``."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor

    def capability(self) -> Capability:
        """Return the identity of the device. Raises OSError, ENOTTY if it is not a video device."""
        data = self._call(QUERYCAP, bytearray(104))
        driver, card, bus, _, all_caps, device_caps = struct.unpack_from("=16s32s32sIII", data)
        caps = device_caps if all_caps & _CAP_DEVICE_CAPS else all_caps
        captures = bool(caps & _CAP_VIDEO_CAPTURE and caps & _CAP_STREAMING)
        return Capability(_text(driver), _text(card), _text(bus), captures)

    def formats(self) -> list[PixelFormat]:
        """Return the formats, sizes and rates that the device offers."""
        found = []
        for data in self._entries(ENUM_FMT, 64, lambda index: struct.pack("=II", index, _CAPTURE)):
            name, pixel_format = struct.unpack_from("=12x32sI", data)
            sizes = tuple(self._sizes(pixel_format))
            found.append(PixelFormat(fourcc_text(pixel_format), _text(name), sizes))
        return found

    def control(self, control_id: int) -> ControlRange | None:
        """Return the allowed range of a control; None if the device does not have it."""
        try:
            data = self._call(QUERYCTRL, bytearray(struct.pack("=I64x", control_id)))
        except OSError:
            return None
        return ControlRange(*struct.unpack_from("=40xiiii", data))

    def check_free(self) -> None:
        """Raise OSError with EBUSY when another process streams from the device."""
        # Requesting zero buffers changes nothing, but requires the same access as requesting some.
        self._call(REQBUFS, bytearray(struct.pack("=III8x", 0, _CAPTURE, _MMAP)))

    def _sizes(self, pixel_format: int) -> Iterator[FrameSize]:
        def request(index: int) -> bytes:
            return struct.pack("=II", index, pixel_format)

        for data in self._entries(ENUM_FRAMESIZES, 44, request):
            kind, width, height = struct.unpack_from("=8xIII", data)
            if kind == _DISCRETE:
                yield FrameSize(width, height, tuple(self._rates(pixel_format, width, height)))
                continue
            # a range: width from, to, step; height from, to, step
            least_width, most_width, _, least_height, most_height, _ = struct.unpack_from("=12xIIIIII", data)
            for one_width, one_height in ((least_width, least_height), (most_width, most_height)):
                rates = tuple(self._rates(pixel_format, one_width, one_height))
                yield FrameSize(one_width, one_height, rates)
            return

    def _rates(self, pixel_format: int, width: int, height: int) -> Iterator[float]:
        def request(index: int) -> bytes:
            return struct.pack("=IIII", index, pixel_format, width, height)

        for data in self._entries(ENUM_FRAMEINTERVALS, 52, request):
            kind, numerator, denominator = struct.unpack_from("=16xIII", data)
            if numerator:
                yield denominator / numerator
            if kind != _DISCRETE:
                return

    def _entries(self, code: int, size: int, request: Callable[[int], bytes]) -> Iterator[bytes]:
        """Query entry 0, 1, … until the device has no more."""
        for index in range(_MOST_ENTRIES):
            try:
                yield self._call(code, bytearray(request(index).ljust(size, b"\0")))
            except OSError as error:
                if error.errno in (errno.EINVAL, errno.ENOTTY):
                    return
                raise

    def _call(self, code: int, data: bytearray) -> bytes:
        fcntl.ioctl(self._descriptor, code, data, True)
        return bytes(data)


@contextmanager
def open_device(path: str) -> Iterator[VideoDevice]:
    """Open a video device for queries, even while another process streams from it. Raises OSError."""
    descriptor = os.open(path, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        yield VideoDevice(descriptor)
    finally:
        os.close(descriptor)


def stop_stream(descriptor: int) -> None:
    """Stop the stream of an open video device, which wakes a waiting reader. Raises OSError."""
    fcntl.ioctl(descriptor, STREAMOFF, struct.pack("=i", _CAPTURE))


def fourcc_text(code: int) -> str:
    """Return a four-character code as text, such as ``MJPG``; "" for 0."""
    letters = (code & 0x7FFFFFFF).to_bytes(4, "little")
    return letters.decode("ascii", "replace").rstrip("\0 ")


def _text(data: bytes) -> str:
    return data.split(b"\0", 1)[0].decode("utf-8", "replace").strip()

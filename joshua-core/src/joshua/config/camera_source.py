"""What the text of a camera's source names: a device, a stream or files; nothing is opened to tell."""

from __future__ import annotations

import posixpath
import re
from enum import Enum

BY_ID_FOLDER = "/dev/v4l/by-id"

_BY_ID_NAME = re.compile(r"[^/]+-video-index\d+")
_NUMBERED_DEVICE = re.compile(r"/dev/video(\d+)")
_SCHEME = re.compile(r"([A-Za-z][A-Za-z0-9+.-]*)://")
_NUMBER_PATTERN = re.compile(r"%0?\d*d")


class SourceKind(Enum):
    """What a source names."""

    DEVICE = "device"
    ADDRESS = "address"
    PICTURES = "numbered pictures"
    FILE = "video file"


def source_kind(source: str) -> SourceKind:
    """What a source names, by its spelling alone."""
    if _SCHEME.match(source):
        return SourceKind.ADDRESS
    if _BY_ID_NAME.fullmatch(source) or posixpath.normpath(source).startswith("/dev/"):
        return SourceKind.DEVICE
    return SourceKind.PICTURES if _NUMBER_PATTERN.search(source) else SourceKind.FILE


def scheme(source: str) -> str:
    """The scheme of an address in lower case, such as ``http``; "" for anything else."""
    match = _SCHEME.match(source)
    return match[1].lower() if match else ""


def device_path(source: str) -> str:
    """The path of a source of kind DEVICE; a bare name stands for its link under /dev/v4l/by-id."""
    return f"{BY_ID_FOLDER}/{source}" if _BY_ID_NAME.fullmatch(source) else posixpath.normpath(source)


def device_identity(source: str) -> str:
    """One spelling for every way to name a device: the index of /dev/videoN, else its path; "" for others."""
    if source_kind(source) is not SourceKind.DEVICE:
        return ""
    path = device_path(source)
    numbered = _NUMBERED_DEVICE.fullmatch(path)
    return numbered[1] if numbered else path

"""The kind of a camera's source, from its text: a device, a stream or files. Nothing is opened."""

from __future__ import annotations

import posixpath
import re
from enum import Enum

BY_ID_FOLDER = "/dev/v4l/by-id"
BY_PATH_FOLDER = "/dev/v4l/by-path"

# Patterns are kept as text, so reading a file without a source compiles none.
# udev's name for the socket begins with the bus of its controller, and contains a colon.
_BY_PATH_NAME = r"(?:acpi|pci|platform)-[^/]*:[^/]*-video-index\d+"
_BY_ID_NAME = r"[^/]+-video-index\d+"
_NUMBERED_DEVICE = r"/dev/video(\d+)"
_SCHEME = r"([A-Za-z][A-Za-z0-9+.-]*)://"
_NUMBER_PATTERN = r"%0?\d*d"


class SourceKind(Enum):
    """Kind of a source."""

    DEVICE = "device"
    ADDRESS = "address"
    PICTURES = "numbered pictures"
    FILE = "video file"


def source_kind(source: str) -> SourceKind:
    """Return the kind of a source from its text alone."""
    if re.match(_SCHEME, source):
        return SourceKind.ADDRESS
    if re.fullmatch(_BY_ID_NAME, source) or posixpath.normpath(source).startswith("/dev/"):
        return SourceKind.DEVICE
    return SourceKind.PICTURES if re.search(_NUMBER_PATTERN, source) else SourceKind.FILE


def scheme(source: str) -> str:
    """Return the scheme of an address in lower case, such as ``http``; "" for anything else."""
    match = re.match(_SCHEME, source)
    return match[1].lower() if match else ""


def device_path(source: str) -> str:
    """Return the path of a device source; a bare name means its link under /dev/v4l/by-id or by-path."""
    if re.fullmatch(_BY_PATH_NAME, source):
        return f"{BY_PATH_FOLDER}/{source}"
    if re.fullmatch(_BY_ID_NAME, source):
        return f"{BY_ID_FOLDER}/{source}"
    return posixpath.normpath(source)


def device_identity(source: str) -> str:
    """Return a canonical name of a device: the index of /dev/videoN, else its path; "" for other sources."""
    if source_kind(source) is not SourceKind.DEVICE:
        return ""
    path = device_path(source)
    numbered = re.fullmatch(_NUMBERED_DEVICE, path)
    return numbered[1] if numbered else path

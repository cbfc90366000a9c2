"""The source of a camera's pictures and its name in messages."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from urllib.parse import urlsplit, urlunsplit

from joshua_camera.settings import CameraSettings
from joshua_camera.source_text import SourceKind, device_path, scheme, source_kind


@dataclass(frozen=True)
class CameraSource:
    """The source of the pictures.

    Attributes:
        kind: of the source.
        target: path of a device or of files, or an address.
        index: N of /dev/videoN if ``device_id`` names the source, else None.
    """

    kind: SourceKind
    target: str
    index: int | None = None

    @classmethod
    def of(cls, settings: CameraSettings) -> CameraSource:
        """Return the source that the settings name."""
        if not settings.source:
            return cls(SourceKind.DEVICE, f"/dev/video{settings.device_id}", settings.device_id)
        kind = source_kind(settings.source)
        target = device_path(settings.source) if kind is SourceKind.DEVICE else settings.source
        return cls(kind, target)

    @property
    def label(self) -> str:
        """Name for messages, without a password."""
        if self.kind is SourceKind.DEVICE and sys.platform != "linux" and self.index is not None:
            return f"camera {self.index}"
        if self.kind is not SourceKind.ADDRESS:
            return self.target
        parts = urlsplit(self.target)
        if parts.username is None and parts.password is None:
            return self.target
        host = parts.netloc.rpartition("@")[2]
        return urlunsplit(parts._replace(netloc=f"***@{host}"))

    @property
    def live(self) -> bool:
        """Whether the camera determines the rate of the pictures."""
        return self.kind in (SourceKind.DEVICE, SourceKind.ADDRESS)

    @property
    def over_tcp(self) -> bool:
        """Whether the address is reached over TCP, so that a connection can be tested first."""
        return scheme(self.target) in ("http", "https", "rtsp", "rtsps", "rtmp", "tcp")

"""A camera at an address: HTTP Motion JPEG, RTSP and everything else that FFmpeg reads."""

from __future__ import annotations

import time
from urllib.parse import urlsplit

from joshua_camera.address import connect, explain
from joshua_camera.capture import Capture
from joshua_camera.interrupt import own_sockets, shut_down
from joshua_camera.limits import stall_limit_s
from joshua_camera.settings import CameraSettings
from joshua_camera.source import CameraSource
from joshua_camera.source_text import scheme

OPEN_TIMEOUT_S = 5.0

#: How much longer FFmpeg's timeout is than that of the reader, so that the reader times out first.
_GRACE_S = 3.0

_PORTS = {"http": 80, "https": 443, "rtsp": 554, "rtsps": 322, "rtmp": 1935}


class StreamCapture(Capture):
    """A camera at an address. Pictures are stamped when their last byte has arrived."""

    def __init__(self, source: CameraSource, settings: CameraSettings) -> None:
        super().__init__(source, settings)
        self._before: set[tuple[int, int]] = set()

    def open(self) -> None:
        """Connect and read the first bytes. Raises DeviceError."""
        settings, cv2 = self.settings, self._load()
        self._before = own_sockets()
        if self.source.over_tcp:
            connect(self.source, self._endpoint(), self._interrupted, OPEN_TIMEOUT_S)
        if self._interrupted.is_set():
            raise self._refuse("was closed while opening", "open it again")
        video = cv2.VideoCapture()
        self._video = video
        read_timeout_s = stall_limit_s(settings.fps) + _GRACE_S
        options = [
            cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, round(OPEN_TIMEOUT_S * 1000),
            cv2.CAP_PROP_READ_TIMEOUT_MSEC, round(read_timeout_s * 1000),
            cv2.CAP_PROP_N_THREADS, 1,  # several threads decode ahead, which delays pictures
        ]  # fmt: skip
        began_s = time.monotonic()
        if not video.open(self.source.target, cv2.CAP_FFMPEG, options):
            if self._interrupted.is_set():
                raise self._refuse("was closed while opening", "open it again")
            raise explain(self.source, time.monotonic() - began_s, OPEN_TIMEOUT_S)
        code = int(video.get(cv2.CAP_PROP_FOURCC))
        if code == cv2.VideoWriter.fourcc(*"MJPG"):
            self.delivers_jpeg = bool(video.set(cv2.CAP_PROP_FORMAT, -1))  # the JPEG files unchanged
        self._note_settings_without_effect()

    def interrupt(self) -> None:
        """Shut down the connections of this camera."""
        self._interrupted.set()
        if self.source.over_tcp and self._video is not None:
            shut_down(own_sockets() - self._before, self._endpoint()[1])

    def _endpoint(self) -> tuple[str, int]:
        parts = urlsplit(self.source.target)
        return parts.hostname or "", parts.port or _PORTS.get(scheme(self.source.target), 0)

    def _note_settings_without_effect(self) -> None:
        names = ("brightness", "contrast", "saturation", "exposure")
        given = [name for name in names if getattr(self.settings, name) is not None]
        if given:
            self.notes.append(
                f"{', '.join(given)}: no effect on {self.source.label}; set it on the camera's own page"
            )

"""OpenCV, loaded once with its own log output off, because JOSHUA reports the errors."""

from __future__ import annotations

import os
from functools import lru_cache
from typing import Any

# OpenCV reads these when it is loaded. FFmpeg's log level -8 is "quiet". The timeout in seconds for a device
# that delivers nothing bounds how long a capture thread can be stuck.
_ENVIRONMENT = {
    "OPENCV_FFMPEG_LOGLEVEL": "-8",
    "OPENCV_LOG_LEVEL": "SILENT",
    "OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT": "5",
}


@lru_cache(maxsize=1)
def load_opencv() -> Any:
    """Return the module ``cv2``; environment variables set by the user take precedence."""
    for name, value in _ENVIRONMENT.items():
        os.environ.setdefault(name, value)
    import cv2

    # One picture is too small to split among threads, and a pool would outlive the camera.
    cv2.setNumThreads(1)
    return cv2

"""Apply the settings of a device in the order that devices require, and read each one back."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Any

from joshua_camera import v4l2
from joshua_camera.settings import CameraSettings

# V4L2 menu values of automatic exposure.
_EXPOSURE_MANUAL = 1
_UNITS_PER_S = 10_000  # V4L2 counts the exposure in 100 µs

_CONTROL_IDS = {
    "brightness": v4l2.CID_BRIGHTNESS,
    "contrast": v4l2.CID_CONTRAST,
    "saturation": v4l2.CID_SATURATION,
    "exposure": v4l2.CID_EXPOSURE_ABSOLUTE,
}


@dataclass(frozen=True)
class Applied:
    """The result of one setting: the requested value and the reported one."""

    name: str
    asked: str
    found: str

    @property
    def kept(self) -> bool:
        """Whether the device applied the requested value."""
        return self.asked == self.found


def apply_format(cv2: Any, video: Any, settings: CameraSettings) -> list[Applied]:
    """Set pixel format, size and rate, in this order because each one limits the next."""
    code = settings.pixel_format
    video.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*code))
    video.set(cv2.CAP_PROP_FRAME_WIDTH, settings.width)
    video.set(cv2.CAP_PROP_FRAME_HEIGHT, settings.height)
    video.set(cv2.CAP_PROP_FPS, settings.fps)
    # Read back only now: a device may revert one setting if the next one does not go with it.
    size = f"{video.get(cv2.CAP_PROP_FRAME_WIDTH):.0f} × {video.get(cv2.CAP_PROP_FRAME_HEIGHT):.0f}"
    found_code = v4l2.fourcc_text(int(video.get(cv2.CAP_PROP_FOURCC)))
    return [
        Applied("pixel_format", code.rstrip(), found_code or code.rstrip()),
        Applied("size", f"{settings.width} × {settings.height}", size),
        Applied("fps", f"{settings.fps:g}", f"{video.get(cv2.CAP_PROP_FPS):g}"),
    ]


def apply_controls(cv2: Any, video: Any, settings: CameraSettings) -> list[Applied]:
    """Set the controls that the settings name; leave the others unchanged."""
    wanted = {
        "brightness": (cv2.CAP_PROP_BRIGHTNESS, settings.brightness),
        "contrast": (cv2.CAP_PROP_CONTRAST, settings.contrast),
        "saturation": (cv2.CAP_PROP_SATURATION, settings.saturation),
        "exposure": (cv2.CAP_PROP_EXPOSURE, exposure_units(settings.exposure)),
    }
    applied = []
    for name, (identifier, value) in wanted.items():
        if value is None:
            continue
        if name == "exposure" and sys.platform == "linux":
            # A device in automatic exposure refuses a value.
            video.set(cv2.CAP_PROP_AUTO_EXPOSURE, _EXPOSURE_MANUAL)
        video.set(identifier, value)
        applied.append(Applied(name, f"{value:g}", f"{video.get(identifier):g}"))
    return applied


def exposure_units(exposure: int | None) -> int | None:
    """Return the exposure in the device's unit.

    V4L2 counts 100 µs. A negative value is the binary logarithm of seconds, as on other systems: -6 is 1/64
    s.
    """
    if exposure is None or exposure >= 0 or sys.platform != "linux":
        return exposure
    return max(1, round(2.0**exposure * _UNITS_PER_S))


def exposure_text(units: float) -> str:
    """Return an exposure in the device's unit as text."""
    if sys.platform != "linux" or units <= 0:
        return f"{units:g}"
    return f"{units / _UNITS_PER_S * 1000:g} ms"


def describe(applied: Applied, device: v4l2.VideoDevice | None) -> str:
    """Return a sentence about a setting that the device did not apply, with the allowed range if known."""
    text = f"{applied.name} {applied.asked}was requested, but the camera uses {applied.found}"
    control_id = _CONTROL_IDS.get(applied.name)
    allowed = device.control(control_id) if device is not None and control_id is not None else None
    if allowed is not None:
        step = f" in steps of {allowed.step}" if allowed.step > 1 else ""
        return f"{text} (allowed: {allowed.minimum} to {allowed.maximum}{step})"
    if control_id is not None and device is not None:
        return f"{applied.name} {applied.asked}was requested, but the camera has no such control"
    return text

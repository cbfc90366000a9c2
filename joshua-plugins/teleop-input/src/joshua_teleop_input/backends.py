"""How gamepads are read on this system."""

from __future__ import annotations

import importlib.util
import sys
from typing import TYPE_CHECKING

from joshua_teleop_input.errors import NoGamepadError
from joshua_teleop_input.settings import GamepadSettings

if TYPE_CHECKING:
    from joshua_teleop_input.sdl_pad import SdlPad


def prefers_sdl(device: str) -> bool:
    """Whether SDL reads a gamepad here: outside Linux, except for shared ones, which have a path."""
    return sys.platform != "linux" and "/" not in device


def sdl_instead(settings: GamepadSettings, reason: NoGamepadError) -> tuple[SdlPad, str]:
    """Try SDL where the kernel's devices cannot be used.

    Returns:
        The gamepad, and what the user should know.

    Raises:
        InputDeviceError: the reason, where SDL has no gamepad either; else why that one cannot be used.
    """
    if importlib.util.find_spec("pygame") is None:
        raise reason
    from joshua_teleop_input.sdl_pad import SdlPad

    try:
        pad = SdlPad(settings)
    except NoGamepadError:
        raise reason from None
    return pad, f"{pad.name} uses SDL, because the kernel's devices are not usable: {reason}"

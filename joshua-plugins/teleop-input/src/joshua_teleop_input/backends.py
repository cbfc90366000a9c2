"""Choice of the gamepad backend on this system."""

from __future__ import annotations

import importlib.util
import sys
from typing import TYPE_CHECKING

from joshua_teleop_input.errors import NoGamepadError
from joshua_teleop_input.settings import GamepadSettings

if TYPE_CHECKING:
    from joshua_teleop_input.sdl_pad import SdlPad


def prefers_sdl(device: str) -> bool:
    """Return whether SDL reads a gamepad: outside Linux, except shared gamepads, which have a path."""
    return sys.platform != "linux" and "/" not in device


def sdl_instead(settings: GamepadSettings, reason: NoGamepadError) -> tuple[SdlPad, str]:
    """Try SDL if the kernel's devices cannot be used.

    Returns:
        The gamepad, and a note for the user.

    Raises:
        InputDeviceError: the given reason if SDL has no gamepad either, or why its gamepad cannot be used.
    """
    if importlib.util.find_spec("pygame") is None:
        raise reason
    from joshua_teleop_input.sdl_pad import SdlPad

    try:
        pad = SdlPad(settings)
    except NoGamepadError:
        raise reason from None
    return pad, f"{pad.name} uses SDL, because the kernel's devices are not usable: {reason}"

"""Help text for the mapped buttons and keys."""

from __future__ import annotations

from joshua_teleop_input.keys import HELP_KEY
from joshua_teleop_input.settings import ControlSettings, GamepadSettings, InputSettings, KeyboardSettings

_WORDS = {"up": "↑", "down": "↓", "left": "←", "right": "→"}


def gamepad_help(settings: GamepadSettings) -> list[str]:
    """Return one line for each control, and how to switch driving on."""
    switch = []
    if settings.enable_button:
        switch.append(f"{settings.enable_button}: switches driving on and off")
    if settings.release_button:
        switch.append(f"{settings.release_button}: returns control after an override")
    if settings.dead_man_button:
        switch.append(f"{settings.dead_man_button}: nothing moves unless it is held")
    return [*_controls(settings), *switch]


def keyboard_help(settings: KeyboardSettings) -> list[str]:
    """Return one line for each control, and the other keys."""
    lines = _controls(settings)
    if settings.enable_key:
        lines.append(f"{settings.enable_key}: switches driving on and off")
    if settings.release_key:
        lines.append(f"{settings.release_key}: returns control after an override")
    return [*lines, f"{HELP_KEY}: shows this    Ctrl-C: ends the run"]


def _controls(settings: InputSettings) -> list[str]:
    names = [_names(control) for control in settings.controls]
    width = max((len(name) for name in names), default=0)
    return [
        f"{name.ljust(width)}  {control.joint}, {control.speed_rad_s:+g} rad/s"
        for name, control in zip(names, settings.controls, strict=True)
    ]


def _names(control: ControlSettings) -> str:
    positive, negative = (_WORDS.get(name, name) for name in (control.positive, control.negative))
    return f"{positive} (+) {negative} (-)" if negative else positive

"""Codes of the Linux input subsystem, from ``linux/input-event-codes.h``."""

from __future__ import annotations

EV_SYN, EV_KEY, EV_ABS = 0, 1, 3
SYN_REPORT, SYN_DROPPED = 0, 3

_ABS_NAMES = ["X", "Y", "Z", "RX", "RY", "RZ", "THROTTLE", "RUDDER", "WHEEL", "GAS", "BRAKE"]
_HATS = [f"HAT{number}{axis}" for number in range(4) for axis in "XY"]

#: Axes by name.
AXES: dict[str, int] = {
    **{f"ABS_{name}": code for code, name in enumerate(_ABS_NAMES)},
    **{f"ABS_{name}": 0x10 + code for code, name in enumerate(_HATS)},
    **{f"ABS_{name}": 0x18 + code for code, name in enumerate(("PRESSURE", "DISTANCE", "TILT_X", "TILT_Y"))},
    "ABS_MISC": 0x28,
}

_JOYSTICK = (
    *("TRIGGER", "THUMB", "THUMB2", "TOP", "TOP2", "PINKIE"),
    *("BASE", "BASE2", "BASE3", "BASE4", "BASE5", "BASE6"),
)
_GAMEPAD = (
    *("SOUTH", "EAST", "C", "NORTH", "WEST", "Z", "TL", "TR", "TL2", "TR2"),
    *("SELECT", "START", "MODE", "THUMBL", "THUMBR"),
)
_DPAD = ("DPAD_UP", "DPAD_DOWN", "DPAD_LEFT", "DPAD_RIGHT")

#: Buttons by name.
BUTTONS: dict[str, int] = {
    **{f"BTN_{number}": 0x100 + number for number in range(10)},
    **{f"BTN_{name}": 0x120 + code for code, name in enumerate(_JOYSTICK)},
    **{f"BTN_{name}": 0x130 + code for code, name in enumerate(_GAMEPAD)},
    "BTN_A": 0x130,
    "BTN_B": 0x131,
    "BTN_X": 0x133,
    "BTN_Y": 0x134,
    **{f"BTN_{name}": 0x220 + code for code, name in enumerate(_DPAD)},
    **{f"BTN_TRIGGER_HAPPY{number}": 0x2BF + number for number in range(1, 41)},
    "KEY_RECORD": 167,
    "KEY_BACK": 158,
    "KEY_HOMEPAGE": 172,
}

_AXIS_NAMES = {code: name for name, code in reversed(list(AXES.items()))}
_BUTTON_NAMES = {code: name for name, code in reversed(list(BUTTONS.items()))}


def axis_name(code: int) -> str:
    """Return the name of an axis, such as ``ABS_RX``; its number if it has no name."""
    return _AXIS_NAMES.get(code, f"ABS_{code}")


def button_name(code: int) -> str:
    """Return the name of a button, such as ``BTN_SOUTH``; its number if it has no name."""
    return _BUTTON_NAMES.get(code, f"BTN_{code:#x}")

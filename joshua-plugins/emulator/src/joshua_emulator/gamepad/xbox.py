"""Controls of an Xbox controller, as reported by the kernel's driver, and their names."""

from __future__ import annotations

NAME = "Emulated Xbox Controller"
IDENTITY = (0x03, 0x045E, 0x028E, 0x0114)

EV_SYN, EV_KEY, EV_ABS = 0, 1, 3

BUTTONS = {
    "a": 0x130,
    "b": 0x131,
    "x": 0x133,
    "y": 0x134,
    "left_bumper": 0x136,
    "right_bumper": 0x137,
    "back": 0x13A,
    "start": 0x13B,
    "guide": 0x13C,
    "left_stick": 0x13D,
    "right_stick": 0x13E,
}

#: Axis by name: code, least and greatest value, noise, centre. Sticks count downwards.
AXES = {
    "left_x": (0, -32768, 32767, 16, 128),
    "left_y": (1, -32768, 32767, 16, 128),
    "left_trigger": (2, 0, 255, 0, 0),
    "right_x": (3, -32768, 32767, 16, 128),
    "right_y": (4, -32768, 32767, 16, 128),
    "right_trigger": (5, 0, 255, 0, 0),
    "dpad_x": (16, -1, 1, 0, 0),
    "dpad_y": (17, -1, 1, 0, 0),
}
_DOWNWARDS = ("left_y", "right_y", "dpad_y")
TRIGGERS = ("left_trigger", "right_trigger")
NAMES = (*AXES, *BUTTONS)


def axis_counts(name: str, value: float) -> int:
    """What the device counts for a deflection: -1 to 1, right and up positive; triggers 0 to 1."""
    _, low, high, _, _ = AXES[name]
    if name in _DOWNWARDS:
        value = -value
    if low == 0:
        return round(high * value)
    return round(value * (high if value > 0 else -low))

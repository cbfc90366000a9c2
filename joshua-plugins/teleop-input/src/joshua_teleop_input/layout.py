"""Names of sticks, triggers and buttons, and their sources on a device.

An axis is positive to the right, up, and for a pressed trigger, independent of the device's own sign.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from joshua_teleop_input.codes import AXES, BUTTONS
from joshua_teleop_input.events import AxisRange, Capabilities

STICKS = ("left_x", "left_y", "right_x", "right_y")
TRIGGERS = ("left_trigger", "right_trigger")
DPAD_AXES = ("dpad_x", "dpad_y")

#: In the message order of ROS 2's game_controller_node.
BUTTON_NAMES = (
    *(
        "a",
        "b",
        "x",
        "y",
        "back",
        "guide",
        "start",
        "left_stick",
        "right_stick",
        "left_bumper",
        "right_bumper",
    ),
    *("dpad_up", "dpad_down", "dpad_left", "dpad_right"),
    *("misc", "paddle_1", "paddle_2", "paddle_3", "paddle_4", "touchpad"),
)
AXIS_NAMES = (*STICKS, *TRIGGERS, *DPAD_AXES)
STANDARD_NAMES = (*AXIS_NAMES, *BUTTON_NAMES)

#: Vendors whose drivers name buttons by position and not by the Xbox letters.
_BY_PLACE = (0x054C, 0x057E)

#: Share of the range from which an axis counts as a pressed button.
PRESSED_FROM = 0.5


@dataclass(frozen=True)
class Source:
    """The source of a value: an axis or a button of the device.

    Attributes:
        code: number of the axis or button; is_axis: which of the two.
        inverted: reverse the sign; half: 1 or -1 uses that half of an axis as a button.
        one_sided: the axis rests at its minimum, as triggers do.
    """

    code: int
    is_axis: bool
    inverted: bool = False
    half: int = 0
    one_sided: bool = False

    def value(self, ranges: Mapping[int, AxisRange], axes: Mapping[int, int], held: Iterable[int]) -> float:
        """Return the value, -1 to 1, or 0 to 1 for buttons and triggers."""
        if not self.is_axis:
            return float((self.code in held) is not self.inverted)
        value = self._position(ranges[self.code], axes[self.code])
        if self.half:
            return float(value * self.half >= PRESSED_FROM)
        return value

    def _position(self, limits: AxisRange, value: int) -> float:
        width = limits.maximum - limits.minimum
        share = (value - limits.minimum) / width if width > 0 else 0.5
        share = min(max(share, 0.0), 1.0)
        if self.one_sided:
            return 1.0 - share if self.inverted else share
        return (1.0 - 2.0 * share) if self.inverted else (2.0 * share - 1.0)


Layout = Mapping[str, Source]


def standard_layout(device: Capabilities) -> dict[str, Source]:
    """Return the Xbox layout of a device, by the rules of the kernel's gamepad drivers."""
    codes = _button_codes(device.vendor)
    layout = {name: Source(code, False) for name, code in codes.items() if code in device.keys}
    for name, axis in _axis_codes(device).items():
        if axis in device.axes:
            layout[name] = Source(axis, True, inverted=name.endswith("_y"), one_sided=name in TRIGGERS)
    for name, code in (("left_trigger", BUTTONS["BTN_TL2"]), ("right_trigger", BUTTONS["BTN_TR2"])):
        if name not in layout and code in device.keys:
            layout[name] = Source(code, False)
    return layout | _dpad(device)


def _axis_codes(device: Capabilities) -> dict[str, int]:
    wireless = AXES["ABS_GAS"] in device.axes and AXES["ABS_BRAKE"] in device.axes
    triggers = ("ABS_BRAKE", "ABS_GAS") if wireless else ("ABS_Z", "ABS_RZ")
    right = ("ABS_Z", "ABS_RZ") if wireless and AXES["ABS_RX"] not in device.axes else ("ABS_RX", "ABS_RY")
    names = ("ABS_X", "ABS_Y", *right, *triggers)
    return {name: AXES[axis] for name, axis in zip((*STICKS, *TRIGGERS), names, strict=True)}


def _button_codes(vendor: int) -> dict[str, int]:
    west, north = ("BTN_WEST", "BTN_NORTH") if vendor in _BY_PLACE else ("BTN_X", "BTN_Y")
    names = {
        "a": "BTN_SOUTH",
        "b": "BTN_EAST",
        "x": west,
        "y": north,
        "back": "BTN_SELECT",
        "guide": "BTN_MODE",
        "start": "BTN_START",
        "left_stick": "BTN_THUMBL",
        "right_stick": "BTN_THUMBR",
        "left_bumper": "BTN_TL",
        "right_bumper": "BTN_TR",
        "misc": "KEY_RECORD",
        **{f"paddle_{number}": f"BTN_TRIGGER_HAPPY{number + 4}" for number in range(1, 5)},
    }
    return {name: BUTTONS[code] for name, code in names.items()}


def _dpad(device: Capabilities) -> dict[str, Source]:
    layout: dict[str, Source] = {}
    for axis, code, (low, high) in (
        ("dpad_x", AXES["ABS_HAT0X"], ("dpad_left", "dpad_right")),
        ("dpad_y", AXES["ABS_HAT0Y"], ("dpad_up", "dpad_down")),
    ):
        if code in device.axes:
            layout[axis] = Source(code, True, inverted=axis == "dpad_y")
            layout[low], layout[high] = Source(code, True, half=-1), Source(code, True, half=1)
    for name in ("dpad_up", "dpad_down", "dpad_left", "dpad_right"):
        code = BUTTONS[f"BTN_{name.upper()}"]
        if code in device.keys:
            layout[name] = Source(code, False)
    return layout


def mapped_source(name: str, source: str, inverted: bool) -> Source:
    """Return the source that a mapping names, such as ``ABS_RX`` or ``BTN_TR2``. Raises KeyError."""
    if source in AXES:
        down_counts = name.endswith("_y")  # the kernel counts down as positive, JOSHUA up
        return Source(AXES[source], True, inverted=inverted is not down_counts, one_sided=name in TRIGGERS)
    return Source(BUTTONS[source], False, inverted=inverted)


def present(layout: Layout, device: Capabilities) -> dict[str, Source]:
    """Return the part of a layout that the device has."""
    return {
        name: source
        for name, source in layout.items()
        if source.code in (device.axes if source.is_axis else device.keys)
    }

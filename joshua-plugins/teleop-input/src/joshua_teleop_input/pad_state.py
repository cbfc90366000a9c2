"""State of the sticks and buttons of a gamepad."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from joshua_teleop_input.codes import EV_ABS, EV_KEY
from joshua_teleop_input.events import Capabilities, InputEvent
from joshua_teleop_input.layout import BUTTON_NAMES, Layout


@dataclass(frozen=True)
class PadState:
    """One state of a gamepad, by name.

    Attributes:
        values: axes from -1 to 1 (right and up are positive), triggers and buttons from 0 to 1.
        live: the state is valid; otherwise all controls count as released.
    """

    values: Mapping[str, float] = field(default_factory=dict)
    live: bool = True

    def value(self, name: str) -> float:
        """Return the value of an axis, trigger or button; 0 if the device has none of that name."""
        return self.values.get(name, 0.0) if self.live else 0.0

    def pressed(self, name: str) -> bool:
        """Return whether a button is pressed, or a trigger or stick is more than half-way."""
        return self.value(name) >= 0.5


class StateTracker:
    """Tracks the state of a device from its records.

    Args:
        device: its capabilities and initial state.
        layout: names of its controls.
    """

    def __init__(self, device: Capabilities, layout: Layout) -> None:
        self._layout = layout
        self.begin(device)

    def begin(self, device: Capabilities) -> None:
        """Load a complete state."""
        self._ranges = dict(device.axes)
        self._axes = {code: facts.value for code, facts in device.axes.items()}
        self._held = set(device.held)

    def take(self, event: InputEvent) -> None:
        """Process a record; unknown controls are ignored."""
        if event.type == EV_KEY:
            (self._held.add if event.value else self._held.discard)(event.code)
        elif event.type == EV_ABS and event.code in self._axes:
            self._axes[event.code] = event.value

    def state(self) -> PadState:
        """Return the present state."""
        values = {
            name: source.value(self._ranges, self._axes, self._held) for name, source in self._layout.items()
        }
        return PadState(values)


#: Axes of the message, in the order of ROS 2's game_controller_node.
JOY_AXES = ("left_x", "left_y", "right_x", "right_y", "left_trigger", "right_trigger")


def joy_values(state: PadState, dead_zone: float) -> tuple[list[float], list[int]]:
    """Axes and buttons of a ``sensor_msgs/msg/Joy``: left, up and a released trigger are the greater values.

    That, the order and the signs are those of ROS 2's game_controller_node.
    """
    from joshua_teleop_input.shaping import without_dead_zone

    # Up is positive in both conventions, right is negative in ROS.
    signs = (-1.0, 1.0, -1.0, 1.0, -1.0, -1.0)
    axes = [
        sign * without_dead_zone(state.value(name), dead_zone) + 0.0
        for name, sign in zip(JOY_AXES, signs, strict=True)
    ]
    return axes, [int(state.pressed(name)) for name in BUTTON_NAMES]

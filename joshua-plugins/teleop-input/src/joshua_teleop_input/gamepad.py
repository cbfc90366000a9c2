"""The gamepad as a sensor: each reading is the state of its sticks and buttons."""

from __future__ import annotations

import time
from collections import deque
from typing import Any, Protocol

from joshua.api import Reading, Sensor, SensorContext
from joshua.api.clocks import StampClock
from joshua.messages import message_class
from joshua.messages.make import header
from joshua.tools import nearest_first

from joshua_teleop_input.discovery import DEVICE_FOLDER, open_gamepad
from joshua_teleop_input.errors import InputDeviceError, NoGamepadError
from joshua_teleop_input.event_pad import EventPad
from joshua_teleop_input.pad_state import PadState, joy_values
from joshua_teleop_input.settings import GamepadSettings

JOY = "sensor_msgs/msg/Joy"
_JOINT_STATE = "sensor_msgs/msg/JointState"


class Pad(Protocol):
    """An open gamepad of any backend."""

    name: str
    names: frozenset[str]

    def read(self, timeout_s: float) -> list[PadState]:
        """Wait for new states. Raises DeviceDisconnected."""

    def close(self) -> None:
        """Close the device. Idempotent."""


class Gamepad(Sensor):
    """A gamepad; ``Reading.data`` is a ``PadState``.

    The first reading after ``connect`` is the state at opening.

    Attributes:
        note: hint for the user on how the device is read; "" for none.
    """

    def __init__(self, settings: GamepadSettings, context: SensorContext | None = None) -> None:
        super().__init__(settings, context)
        self.note = ""
        self._pad: Pad | None = None
        self._name = ""
        self._states: deque[PadState] = deque()
        self._clock = StampClock()
        self._sequence = 0

    @property
    def data_types(self) -> tuple[str, ...]:
        """Type that ``message`` returns; the node publishes the commands."""
        return (JOY,)

    @property
    def connected(self) -> bool:
        """Whether the device is open."""
        return self._pad is not None

    @property
    def name(self) -> str:
        """Name of the present or last device."""
        return self._name

    def connect(self) -> None:
        """Open the device and check that it has the controls that the file uses. Raises InputDeviceError."""
        self.disconnect()
        pad = self._open()
        missing = [name for name in self._used() if name not in pad.names]
        if missing:
            pad.close()
            raise InputDeviceError(
                f"{pad.name} has no {', '.join(missing)}; it has "
                f"{', '.join(nearest_first(missing[0], sorted(pad.names)))}: use those, or name the others "
                "with mapping (joshua find-gamepads --watch shows what you press)"
            )
        self._pad, self._name, self._sequence = pad, pad.name, 0

    def read(self, timeout_s: float) -> Reading | None:
        """Wait for the next state. Raises DeviceDisconnected."""
        self.require_connected("read")
        assert self._pad is not None
        end_s = time.monotonic() + timeout_s
        while not self._states:
            left_s = max(0.0, end_s - time.monotonic())
            self._states.extend(self._pad.read(left_s))
            if not self._states and left_s <= 0.0:
                return None
        reading = Reading(self._clock.now_ns(), self._sequence, self._states.popleft())
        self._sequence += 1
        return reading

    def message(self, reading: Reading, type_name: str, frame_id: str) -> Any:
        """Return a Joy, in the order of ROS 2's game_controller_node."""
        if type_name != JOY:
            raise InputDeviceError(f"a gamepad's state is no {type_name}: allowed is {JOY}")
        axes, buttons = joy_values(reading.data, self.settings.dead_zone)
        return message_class(JOY)(header(frame_id, reading.stamp_ns), axes, buttons)

    def disconnect(self) -> None:
        """Close the device. Idempotent."""
        pad, self._pad = self._pad, None
        self._states.clear()
        if pad is not None:
            pad.close()

    def _open(self) -> Pad:
        from joshua_teleop_input.backends import prefers_sdl, sdl_instead

        settings: GamepadSettings = self.settings
        self.note = ""
        if not prefers_sdl(settings.device):
            try:
                return EventPad(open_gamepad(settings.device, DEVICE_FOLDER), settings)
            except NoGamepadError as error:
                pad, self.note = sdl_instead(settings, error)
                return pad
        from joshua_teleop_input.sdl_pad import SdlPad

        return SdlPad(settings)

    def _used(self) -> list[str]:
        settings: GamepadSettings = self.settings
        names = [
            *(name for control in settings.controls for name in (control.positive, control.negative)),
            settings.dead_man_button,
            settings.enable_button,
            settings.release_button,
        ]
        return list(dict.fromkeys(name for name in names if name))

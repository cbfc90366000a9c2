"""Control a recording with the buttons of a gamepad, from its ``sensor_msgs/msg/Joy``."""

from __future__ import annotations

import queue
from collections.abc import Callable, Mapping
from typing import Any

from joshua.api import NodeContext, RefusedError

JOY = "sensor_msgs/msg/Joy"

#: Names of a Joy's buttons, in the order of ROS 2's game_controller_node.
NAMES = (
    *("a", "b", "x", "y", "back", "guide", "start", "left_stick", "right_stick"),
    *("left_bumper", "right_bumper", "dpad_up", "dpad_down", "dpad_left", "dpad_right"),
    *("misc", "paddle_1", "paddle_2", "paddle_3", "paddle_4", "touchpad"),
)


class Buttons:
    """Calls an action when its button is pressed; a button held at the start counts only after its release.

    Args:
        context: of the node; actions: by the name of their button.
    """

    def __init__(self, context: NodeContext, actions: Mapping[str, Callable[[], str]]) -> None:
        self._context = context
        self._actions = {NAMES.index(name): action for name, action in actions.items()}
        self._held: set[int] | None = None
        self._pressed: queue.Queue[Callable[[], str]] = queue.Queue(4)

    def take(self, message: Any, received_ns: int) -> None:
        """Receive a state of the gamepad (on a transport thread)."""
        del received_ns
        held = {number for number, value in enumerate(message.buttons) if value}
        new = held - (held if self._held is None else self._held)
        self._held = held
        for number in sorted(new & self._actions.keys()):
            if not self._pressed.full():
                self._pressed.put(self._actions[number])

    def run(self) -> None:
        """Run the actions of pressed buttons until the node stops (on its own thread)."""
        while not self._context.stopping:
            try:
                action = self._pressed.get(timeout=0.2)
            except queue.Empty:
                continue
            try:
                self._context.log.info("%s", action())
            except RefusedError as error:
                self._context.log.warning("%s", error)

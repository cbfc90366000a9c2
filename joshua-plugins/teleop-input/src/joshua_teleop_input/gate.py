"""Gate for user input: dead-man button, enable switch, and a fresh start after a disconnection."""

from __future__ import annotations

from collections.abc import Callable

Pressed = Callable[[str], bool]


class Gate:
    """Decides from the state of two buttons whether driving is on.

    A button that is held when the device appears or reappears has no effect until it was released.

    Args:
        dead_man: name of the button that must be held; "" for none.
        enable: name of the button that toggles driving; "" for none.
    """

    def __init__(self, dead_man: str, enable: str) -> None:
        self._dead_man, self._enable = dead_man, enable
        self._dead_man_was_up = False
        self._dead_man_held = False
        self._enable_was_up = False
        self._enabled = False
        self._live = False

    @property
    def has_buttons(self) -> bool:
        """Whether driving must be switched on."""
        return bool(self._dead_man or self._enable)

    @property
    def active(self) -> bool:
        """Whether driving is on."""
        held = self._dead_man_held or not self._dead_man
        return self._live and held and (self._enabled or not self._enable)

    @property
    def enabled(self) -> bool:
        """Whether the switch is on."""
        return self._enabled

    def update(self, pressed: Pressed) -> None:
        """Update from a valid device state."""
        self._live = True
        if self._dead_man:
            down = pressed(self._dead_man)
            self._dead_man_was_up |= not down
            self._dead_man_held = down and self._dead_man_was_up
        if self._enable:
            down = pressed(self._enable)
            if down and self._enable_was_up:
                self._enabled = not self._enabled
            self._enable_was_up = not down

    def switch_off(self) -> None:
        """Switch driving off; held buttons have no effect until they were released."""
        self._enabled = self._dead_man_held = False
        self._dead_man_was_up = self._enable_was_up = False

    def close(self) -> None:
        """Switch driving off because the device is disconnected or stale."""
        self.switch_off()
        self._live = False

    def describe(self) -> str:
        """Return the state as text."""
        if not self._live:
            return "off: no input device"
        if self._enable and not self._enabled:
            return f"off: press {self._enable} to switch driving on"
        if self._dead_man and not self._dead_man_held:
            return f"off: hold {self._dead_man} to drive"
        return "ON"

"""Whether a person's input may move anything: dead-man button, switch, a fresh start after a loss."""

from __future__ import annotations

from collections.abc import Callable

Pressed = Callable[[str], bool]


class Gate:
    """Decides from the state of two buttons whether driving is on.

    A button that is held when the device appears, or appears again, counts only after it was released.

    Args:
        dead_man: name of the button that must be held; "" for none.
        enable: name of the button that switches driving on and off; "" for none.
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
        """Whether driving has to be switched on at all."""
        return bool(self._dead_man or self._enable)

    @property
    def active(self) -> bool:
        """Whether input moves anything."""
        held = self._dead_man_held or not self._dead_man
        return self._live and held and (self._enabled or not self._enable)

    @property
    def enabled(self) -> bool:
        """Whether the switch is on."""
        return self._enabled

    def update(self, pressed: Pressed) -> None:
        """Take a state of a device that can be trusted."""
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
        """Switch driving off; buttons that are held count only after they were released."""
        self._enabled = self._dead_man_held = False
        self._dead_man_was_up = self._enable_was_up = False

    def close(self) -> None:
        """Switch driving off: the device is lost, or cannot be trusted."""
        self.switch_off()
        self._live = False

    def describe(self) -> str:
        """The state, for people."""
        if not self._live:
            return "off: no input device"
        if self._enable and not self._enabled:
            return f"off: press {self._enable} to switch driving on"
        if self._dead_man and not self._dead_man_held:
            return f"off: hold {self._dead_man} to drive"
        return "ON"

"""A gamepad read by SDL: outside Linux, and if the kernel's devices cannot be used.

SDL knows the layout of most gamepads. It runs on one dedicated thread, because some systems deliver events
only to the thread that opened it.
"""

from __future__ import annotations

import importlib
import os
import queue
import threading
from typing import Any

from joshua.api import DeviceDisconnected
from joshua.tools import nearest_first

from joshua_teleop_input.errors import InputDeviceError, NoGamepadError
from joshua_teleop_input.layout import BUTTON_NAMES, STICKS, TRIGGERS
from joshua_teleop_input.pad_state import PadState

_POLL_S = 0.004
_OPEN_TIMEOUT_S = 10.0
_FULL = 32767

#: SDL counts axes and buttons in this order.
_AXES = (*STICKS, *TRIGGERS)
_BUTTONS = BUTTON_NAMES[:15]

_SETTINGS = {
    "PYGAME_HIDE_SUPPORT_PROMPT": "1",
    "SDL_VIDEODRIVER": "dummy",  # no window is needed, and there may be no display
    "SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS": "1",
    "SDL_NO_SIGNAL_HANDLERS": "1",
}

_in_use = threading.Lock()


class SdlPad:
    """An open gamepad; a process has one at a time.

    Args:
        settings: of the gamepad.

    Raises:
        InputDeviceError: there is no gamepad, or SDL cannot be used.
    """

    def __init__(self, settings: Any) -> None:
        self.name = ""
        self.names = frozenset((*_AXES, "dpad_x", "dpad_y", *_BUTTONS))
        self._wanted = settings.device
        self._has_mapping = bool(settings.mapping)
        self._states: queue.Queue[PadState | None] = queue.Queue()
        self._opened = threading.Event()
        self._closing = threading.Event()
        self._problem: Exception | None = None
        if not _in_use.acquire(blocking=False):
            raise InputDeviceError(
                "SDL reads only one gamepad in each process: give the second one a node in another process"
            )
        self._thread = threading.Thread(target=self._run, name="sdl", daemon=True)
        self._thread.start()
        self._opened.wait(_OPEN_TIMEOUT_S)
        if not self._opened.is_set():
            self._problem = InputDeviceError("SDL does not answer: unplug the gamepad and plug it in again")
        if self._problem is not None:
            self.close()
            raise self._problem

    def read(self, timeout_s: float) -> list[PadState]:
        """Wait for a new state. Raises DeviceDisconnected."""
        try:
            state = self._states.get(timeout=timeout_s) if timeout_s > 0 else self._states.get_nowait()
        except queue.Empty:
            return []
        if state is None:
            raise DeviceDisconnected(f"{self.name} is disconnected: unplugged, or its battery is empty")
        return [state]

    def close(self) -> None:
        """Close the device and end the thread. Idempotent."""
        self._closing.set()
        self._thread.join(_OPEN_TIMEOUT_S)

    def _run(self) -> None:
        try:
            self._watch()
        except Exception as error:  # noqa: BLE001 - handed to the thread that waits
            self._problem = error
            self._states.put(None)
        finally:
            self._opened.set()
            _in_use.release()

    def _watch(self) -> None:
        for name, value in _SETTINGS.items():
            os.environ.setdefault(name, value)
        try:
            pygame: Any = importlib.import_module("pygame")
            controllers: Any = importlib.import_module("pygame._sdl2.controller")
        except ImportError as error:
            raise InputDeviceError(
                f"gamepads are read by SDL here, which is not installed ({error}): pip install pygame"
            ) from error
        pygame.display.init()
        controllers.init()
        try:
            pad = self._open(controllers)
            self._opened.set()
            self._follow(pygame, pad)
            pad.quit()
        finally:
            controllers.quit()
            pygame.display.quit()

    def _open(self, controllers: Any) -> Any:
        numbers = [number for number in range(controllers.get_count()) if controllers.is_controller(number)]
        names = {number: str(controllers.name_forindex(number)) for number in numbers}
        for number, name in names.items():
            if self._wanted.lower() in name.lower():
                if self._has_mapping:
                    raise InputDeviceError(
                        f"mapping names axes and buttons of the Linux kernel, but SDL reads {name}: remove "
                        "mapping; SDL takes its own from the environment variable SDL_GAMECONTROLLERCONFIG"
                    )
                self.name = f"{name} (SDL)"
                return controllers.Controller(number)
        if names:
            raise InputDeviceError(
                f"no gamepad whose name contains {self._wanted!r} is connected; connected are "
                f"{', '.join(nearest_first(self._wanted, names.values()))}: correct device, or omit it"
            )
        raise NoGamepadError(
            "no gamepad is connected: plug it in or switch it on; "
            "run joshua find-gamepads to list detected gamepads"
        )

    def _follow(self, pygame: Any, pad: Any) -> None:
        last: dict[str, float] | None = None
        while not self._closing.wait(_POLL_S):
            pygame.event.pump()
            if not pad.attached():
                self._states.put(None)
                return
            values = _values(pad)
            if values != last:
                last = values
                self._states.put(PadState(values))


def _values(pad: Any) -> dict[str, float]:
    axes = {name: max(-1.0, pad.get_axis(index) / _FULL) for index, name in enumerate(_AXES)}
    for name in ("left_y", "right_y"):
        axes[name] = 0.0 - axes[name]  # SDL counts down as positive
    buttons = {name: float(pad.get_button(index)) for index, name in enumerate(_BUTTONS)}
    dpad = {
        "dpad_x": buttons["dpad_right"] - buttons["dpad_left"],
        "dpad_y": buttons["dpad_up"] - buttons["dpad_down"],
    }
    return axes | buttons | dpad


def names_found() -> list[str]:
    """Return the names of the gamepads that SDL detects; none if SDL is not installed."""
    for name, value in _SETTINGS.items():
        os.environ.setdefault(name, value)
    try:
        pygame: Any = importlib.import_module("pygame")
        controllers: Any = importlib.import_module("pygame._sdl2.controller")
    except ImportError:
        return []
    pygame.display.init()
    controllers.init()
    try:
        numbers = range(controllers.get_count())
        return [
            str(controllers.name_forindex(number)) for number in numbers if controllers.is_controller(number)
        ]
    finally:
        controllers.quit()
        pygame.display.quit()

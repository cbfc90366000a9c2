"""Which gamepads there are, and which one a file means."""

from __future__ import annotations

import os
import stat
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from joshua.api import DeviceDisconnected
from joshua.tools import nearest_first

from joshua_teleop_input.codes import AXES, BUTTONS
from joshua_teleop_input.errors import InputDeviceError, NoGamepadError
from joshua_teleop_input.events import Capabilities, InputEvent
from joshua_teleop_input.kernel_device import KernelDevice
from joshua_teleop_input.remote_device import RemoteDevice

#: Where the kernel's input devices are.
DEVICE_FOLDER = Path("/dev/input")

_GAMEPAD_BUTTONS = {BUTTONS["BTN_SOUTH"], BUTTONS["BTN_TRIGGER"], BUTTONS["BTN_0"]}


class EventDevice(Protocol):
    """A gamepad that hands over the kernel's records.

    Attributes:
        silence_limit_s: silence after which nothing that was heard can be trusted; None for no limit.
    """

    path: str
    capabilities: Capabilities
    silence_limit_s: float | None

    def grab(self) -> None:
        """Take the device for this process alone."""

    def read(self, timeout_s: float) -> list[InputEvent]:
        """Wait for records."""

    def resynchronise(self) -> Capabilities:
        """Return the present state after records were lost. Raises DeviceDisconnected."""

    def close(self) -> None:
        """Close the device. Idempotent."""


@dataclass(frozen=True)
class Found:
    """A device file: its kind, or why it is unknown."""

    path: str
    capabilities: Capabilities | None
    problem: str = ""

    @property
    def is_gamepad(self) -> bool:
        """Whether it has the buttons and axes of a gamepad or a joystick."""
        device = self.capabilities
        return device is not None and bool(device.keys & _GAMEPAD_BUTTONS) and AXES["ABS_X"] in device.axes


def find_devices(folder: Path) -> list[Found]:
    """Look at every input device of this machine, in the order of their numbers."""
    paths = sorted(folder.glob("event*"), key=lambda path: (len(path.name), path.name))
    return [_look_at(str(path)) for path in paths]


def _look_at(path: str) -> Found:
    try:
        device = KernelDevice(path)
    except (InputDeviceError, DeviceDisconnected) as error:
        return Found(path, None, str(error))
    device.close()
    return Found(path, device.capabilities)


def open_gamepad(wanted: str, folder: Path = DEVICE_FOLDER) -> EventDevice:
    """Open the gamepad that a file means and take it for this process alone.

    Args:
        wanted: path of a device or a socket, part of a name in whatever case, or "" for the first one.
        folder: where devices are looked for.

    Raises:
        InputDeviceError: there is none, several fit, or it cannot be used.
    """
    device = _open_path(wanted) if "/" in wanted else KernelDevice(find_by_name(wanted, folder))
    try:
        device.grab()
    except BaseException:
        device.close()
        raise
    return device


def _open_path(path: str) -> EventDevice:
    path = os.path.expanduser(path)  # noqa: PTH111 - links and relative paths stay as they are
    try:
        is_socket = stat.S_ISSOCK(os.stat(path).st_mode)  # noqa: PTH116
    except OSError:
        is_socket = path.endswith(".sock")
    return RemoteDevice(path) if is_socket else KernelDevice(path)


def find_by_name(wanted: str, folder: Path) -> str:
    """Path of the gamepad with a name. Raises InputDeviceError; NoGamepadError where there is none at all."""
    found = find_devices(folder)
    pads = [device for device in found if device.is_gamepad]
    fitting = [pad for pad in pads if pad.capabilities and wanted.lower() in pad.capabilities.name.lower()]
    if fitting:
        return fitting[0].path
    what = f"no gamepad whose name contains {wanted!r}" if wanted else "no gamepad"
    refused = [device for device in found if "may not be read" in device.problem]
    if pads:
        names = nearest_first(wanted, [pad.capabilities.name for pad in pads if pad.capabilities])
        raise InputDeviceError(
            f"{what} is connected; there is {', '.join(names)}: correct device, or leave it out"
        )
    if refused:
        raise NoGamepadError(
            f"{what} can be seen, and {len(refused)} input devices such as {refused[0].path} may not be read "
            "by this user: add the user to the group input (sudo usermod -aG input $USER, then log in again)"
        )
    raise NoGamepadError(
        f"{what} is connected: plug it in or switch it on; run joshua find-gamepads to list detected gamepads"
    )

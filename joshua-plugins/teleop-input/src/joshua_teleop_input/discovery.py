"""Find gamepads, and the one that a file refers to."""

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

#: Folder of the kernel's input devices.
DEVICE_FOLDER = Path("/dev/input")

_GAMEPAD_BUTTONS = {BUTTONS["BTN_SOUTH"], BUTTONS["BTN_TRIGGER"], BUTTONS["BTN_0"]}


class EventDevice(Protocol):
    """A gamepad that delivers the kernel's input records.

    Attributes:
        silence_limit_s: time without data after which the state is stale; None for no limit.
    """

    path: str
    capabilities: Capabilities
    silence_limit_s: float | None

    def grab(self) -> None:
        """Grab the device exclusively for this process."""

    def read(self, timeout_s: float) -> list[InputEvent]:
        """Wait for records."""

    def resynchronise(self) -> Capabilities:
        """Return the present state after records were lost. Raises DeviceDisconnected."""

    def close(self) -> None:
        """Close the device. Idempotent."""


@dataclass(frozen=True)
class Found:
    """A device file with its capabilities, or the reason why they are unknown."""

    path: str
    capabilities: Capabilities | None
    problem: str = ""

    @property
    def is_gamepad(self) -> bool:
        """Return whether it has the buttons and axes of a gamepad or joystick."""
        device = self.capabilities
        return device is not None and bool(device.keys & _GAMEPAD_BUTTONS) and AXES["ABS_X"] in device.axes


def find_devices(folder: Path) -> list[Found]:
    """Query every input device of this machine, by ascending number."""
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
    """Open the gamepad that a file refers to and grab it exclusively.

    Args:
        wanted: path of a device or a socket, case-insensitive part of a name, or "" for the first gamepad.
        folder: that contains the devices.

    Raises:
        InputDeviceError: no gamepad matches, several do, or it cannot be used.
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
    """Return the path of a gamepad by name. Raises InputDeviceError; NoGamepadError if there is none."""
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
            f"{what} is connected; connected are {', '.join(names)}: correct device, or omit it"
        )
    if refused:
        raise NoGamepadError(
            f"{what} was found, and this user may not read {len(refused)} input devices such as "
            f"{refused[0].path}: add the user to the group input (sudo usermod -aG input $USER, then log in "
            "again)"
        )
    raise NoGamepadError(
        f"{what} is connected: plug it in or switch it on; run joshua find-gamepads to list detected gamepads"
    )

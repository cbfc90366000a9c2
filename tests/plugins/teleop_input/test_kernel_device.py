"""Input devices of the kernel: the queries, and every way in which one cannot be used."""

from __future__ import annotations

import errno
import fcntl
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from gamepads import STICK, gamepad_settings
from joshua.devices.errors import DeviceDisconnected
from joshua_teleop_input import discovery, kernel_device
from joshua_teleop_input.codes import AXES, BUTTONS
from joshua_teleop_input.discovery import Found, find_by_name, find_devices, open_gamepad
from joshua_teleop_input.errors import InputDeviceError
from joshua_teleop_input.events import NATIVE_RECORD, AxisRange, Capabilities
from joshua_teleop_input.gamepad import Gamepad

PROGRAM = """
#include <linux/input.h>
#include <stdio.h>
int main(void) {
  printf("%lu %lu %lu %lu %lu %lu %lu %zu %zu\\n", (unsigned long)EVIOCGID, (unsigned long)EVIOCGNAME(256),
    (unsigned long)EVIOCGKEY(96), (unsigned long)EVIOCGRAB, (unsigned long)EVIOCGBIT(EV_KEY, 96),
    (unsigned long)EVIOCGBIT(EV_ABS, 8), (unsigned long)EVIOCGABS(ABS_RX), sizeof(struct input_event),
    sizeof(struct input_absinfo));
}
"""


@pytest.mark.skipif(
    not (shutil.which("cc") and Path("/usr/include/linux/input.h").exists()),
    reason="no C compiler, or no headers of the kernel",
)
def test_the_queries_are_those_of_the_kernel(tmp_path: Path) -> None:
    (tmp_path / "numbers.c").write_text(PROGRAM)
    subprocess.run(["cc", "numbers.c", "-o", "numbers"], cwd=tmp_path, check=True)
    done = subprocess.run([str(tmp_path / "numbers")], capture_output=True, text=True, check=True)
    assert [int(number) for number in done.stdout.split()] == [
        kernel_device.EVIOCGID,
        kernel_device.EVIOCGNAME,
        kernel_device.EVIOCGKEY,
        kernel_device.EVIOCGRAB,
        kernel_device.eviocgbit(1, 96),
        kernel_device.eviocgbit(3, 8),
        kernel_device.eviocgabs(3),
        NATIVE_RECORD.size,
        24,
    ]


def test_a_missing_device_is_named() -> None:
    with pytest.raises(InputDeviceError, match="there is no /dev/input/event99; run joshua find-gamepads"):
        open_gamepad("/dev/input/event99")


def test_something_else_is_no_input_device() -> None:
    with pytest.raises(InputDeviceError, match=r"/dev/null is not an input device .*find-gamepads"):
        open_gamepad("/dev/null")


def refuse(monkeypatch: pytest.MonkeyPatch, path: str, number: int) -> None:
    """Lets the system refuse to open a file, as it does for a user without the right."""
    system_open = os.open

    def opening(name: Any, *arguments: Any, **named: Any) -> int:
        if str(name) == path:
            raise OSError(number, os.strerror(number), path)
        return system_open(name, *arguments, **named)

    monkeypatch.setattr(os, "open", opening)


def test_a_device_that_may_not_be_read(monkeypatch: pytest.MonkeyPatch) -> None:
    refuse(monkeypatch, "/dev/input/event3", errno.EACCES)
    with pytest.raises(InputDeviceError, match=r"may not be read by this user: .* usermod -aG input"):
        open_gamepad("/dev/input/event3")


def test_a_device_that_cannot_be_opened(monkeypatch: pytest.MonkeyPatch) -> None:
    refuse(monkeypatch, "/dev/input/event3", errno.ENXIO)
    with pytest.raises(
        InputDeviceError, match="/dev/input/event3 cannot be opened: No such device or address"
    ):
        open_gamepad("/dev/input/event3")


def answer_queries(monkeypatch: pytest.MonkeyPatch, grab: int) -> None:
    """Lets the kernel answer for a gamepad; ``grab`` is the error of taking it for oneself."""

    def ioctl(_: int, request: int, argument: Any = 0) -> Any:
        if request == kernel_device.EVIOCGRAB:
            raise OSError(grab, os.strerror(grab))
        if request == kernel_device.EVIOCGNAME:
            return b"Some Pad".ljust(256, b"\0")
        return argument

    monkeypatch.setattr(fcntl, "ioctl", ioctl)


def test_a_device_that_another_program_has_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    answer_queries(monkeypatch, errno.EBUSY)
    with pytest.raises(
        InputDeviceError, match=r"Some Pad \(/dev/null\) is in use: another program uses it exclusively"
    ):
        open_gamepad("/dev/null")


def test_a_device_that_vanishes_while_it_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    answer_queries(monkeypatch, errno.ENODEV)
    with pytest.raises(DeviceDisconnected, match="/dev/null is gone"):
        open_gamepad("/dev/null")


def pad(path: str, name: str) -> Found:
    keys = frozenset({BUTTONS["BTN_SOUTH"]})
    return Found(path, Capabilities(name, keys=keys, axes={AXES["ABS_X"]: AxisRange(0, -1, 1)}))


def test_the_list_of_those_found_is_in_the_message(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    found = [pad("/dev/input/event5", "Sony Wireless Controller"), pad("/dev/input/event7", "Xbox 360 pad")]
    found.append(Found("/dev/input/event1", Capabilities("Power Button", keys=frozenset({116}))))
    monkeypatch.setattr(discovery, "find_devices", lambda folder: found)
    assert find_by_name("", tmp_path) == "/dev/input/event5"
    assert find_by_name("xbox", tmp_path) == "/dev/input/event7"
    with pytest.raises(InputDeviceError, match=r"contains 'Xbax' is connected; connected are .*Xbox 360 pad"):
        find_by_name("Xbax", tmp_path)


def test_no_gamepad_at_all(tmp_path: Path) -> None:
    with pytest.raises(InputDeviceError, match="no gamepad is connected: plug it in or switch it on"):
        find_by_name("", tmp_path)
    with pytest.raises(InputDeviceError, match="no gamepad whose name contains 'Xbox' is connected"):
        find_by_name("Xbox", tmp_path)


def test_a_gamepad_in_use_is_not_tried_by_sdl(monkeypatch: pytest.MonkeyPatch) -> None:
    """SDL would open it and hear nothing: the message about the other program must come through."""
    answer_queries(monkeypatch, errno.EBUSY)
    monkeypatch.setattr(discovery, "find_by_name", lambda wanted, folder: "/dev/null")
    with pytest.raises(InputDeviceError, match="is in use"):
        Gamepad(gamepad_settings(STICK)).connect()


def test_devices_that_nobody_may_look_at(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    path = tmp_path / "event0"
    path.touch()
    refuse(monkeypatch, str(path), errno.EACCES)
    assert "may not be read" in find_devices(tmp_path)[0].problem
    with pytest.raises(
        InputDeviceError, match=r"this user may not read 1 input devices such as .*event0: .*group input"
    ):
        find_by_name("Xbox", tmp_path)

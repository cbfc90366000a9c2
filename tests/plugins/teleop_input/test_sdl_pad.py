"""Gamepads by SDL, at a virtual one that SDL attaches inside this process."""

from __future__ import annotations

import ctypes
import subprocess
import sys

import pytest

pytest.importorskip("pygame")

# SDL keeps its state in the process: each case has one of its own.
BEGIN = """
import ctypes, glob, os, time
os.environ.update(SDL_VIDEODRIVER="dummy", PYGAME_HIDE_SUPPORT_PROMPT="1")
import pygame
from gamepads import STICK, gamepad_settings
from joshua.devices.errors import DeviceDisconnected
from joshua_teleop_input.errors import InputDeviceError
from joshua_teleop_input.sdl_pad import SdlPad, names_found
library = glob.glob(os.path.join(os.path.dirname(pygame.__file__), "..", "pygame.libs", "libSDL2-2*"))[0]
sdl = ctypes.CDLL(library)
sdl.SDL_Init(0x200)  # joysticks; stays initialised beside the driver's own
index = sdl.SDL_JoystickAttachVirtual(1, 6, 15, 0)  # a gamepad
sdl.SDL_JoystickOpen.restype = ctypes.c_void_p
joystick = ctypes.c_void_p(sdl.SDL_JoystickOpen(index))

def state(pad, condition):
    end = time.monotonic() + 40
    while time.monotonic() < end:
        for found in pad.read(0.1):
            if condition(found):
                return found
    raise AssertionError("no such state")
"""
FOLLOWS = """
pad = SdlPad(gamepad_settings(STICK))
assert "(SDL)" in pad.name, pad.name
sdl.SDL_JoystickSetVirtualAxis(joystick, 0, 32767)
sdl.SDL_JoystickSetVirtualAxis(joystick, 1, -32768)
sdl.SDL_JoystickSetVirtualButton(joystick, 0, 1)
found = state(pad, lambda item: item.pressed("a"))
assert found.value("left_x") == 1.0, found
assert found.value("left_y") == 1.0, found
sdl.SDL_JoystickSetVirtualButton(joystick, 0, 0)
state(pad, lambda item: not item.pressed("a"))
try:
    SdlPad(gamepad_settings(STICK))
except InputDeviceError as error:
    assert "one gamepad in each process" in str(error)
sdl.SDL_JoystickDetachVirtual(index)
try:
    state(pad, lambda item: False)
except DeviceDisconnected as error:
    print("lost:", error)
pad.close()
"""
NAMES = """
print(names_found())
for block in ('device: "Xbax" ' + STICK, 'mapping { name: "z" source: "ABS_X" }'):
    try:
        SdlPad(gamepad_settings(block))
    except InputDeviceError as error:
        print("refused:", error)
sdl.SDL_JoystickDetachVirtual(index)
try:
    SdlPad(gamepad_settings(STICK))
except InputDeviceError as error:
    print("refused:", error)
"""

FALLS_BACK = """
from pathlib import Path
from joshua_teleop_input import discovery, gamepad
gamepad.DEVICE_FOLDER = Path("/nonexistent")
device = gamepad.Gamepad(gamepad_settings(STICK))
device.connect()
print(device.note)
print("state:", device.read(30.0).data.value("left_x"))
device.disconnect()
"""


def run(program: str) -> str:
    paths = [entry for entry in sys.path if entry]
    prefix = f"import sys; sys.path[:0] = {paths!r}\n"
    done = subprocess.run(
        [sys.executable, "-c", prefix + BEGIN + program], capture_output=True, text=True, timeout=100
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_it_follows_sticks_and_buttons_until_it_is_unplugged() -> None:
    assert "lost: " in run(FOLLOWS)
    assert ctypes.sizeof(ctypes.c_void_p) == 8


def test_what_cannot_be_opened_is_explained() -> None:
    out = run(NAMES)
    assert "refused: no gamepad whose name contains 'Xbax' is connected; connected are " in out
    assert "refused: mapping names axes and buttons of the Linux kernel, but SDL reads " in out
    assert "refused: no gamepad is connected: plug it in or switch it on" in out


def test_it_is_the_way_out_where_the_kernel_shows_no_gamepad() -> None:
    out = run(FALLS_BACK)
    assert "(SDL) uses SDL, because the kernel's devices are not usable: no gamepad is connected" in out
    assert "state: 0.0" in out

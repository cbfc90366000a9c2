"""``joshua find-gamepads``: list the gamepads of this machine and show the names of pressed controls."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import argparse

    from joshua_teleop_input.discovery import EventDevice, Found

SUMMARY = "list the gamepads of this machine, and show the names of pressed controls"

NOTHING = """no gamepad was found

Plug one in or switch it on. If it is on already:
  - lsusb (by cable) or bluetoothctl devices Connected (by radio) shows whether the computer sees it
  - in a container or a virtual machine, pass the device on (such as docker run --device /dev/input)
  - a gamepad of another machine is used with joshua share-gamepad
"""

#: Share of its range that an axis must move to be reported.
_NOTICEABLE = 0.3


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``joshua find-gamepads``."""
    import argparse

    parser.add_argument(
        "--watch",
        metavar="DEVICE",
        nargs="?",
        const="",
        help="show the pressed controls of a gamepad, named by its path or a part of its name, until Ctrl-C",
    )
    parser.add_argument(
        "--duration", metavar="S", type=float, default=None, help="length of --watch in seconds"
    )
    parser.add_argument("--format", choices=("text", "json"), default=argparse.SUPPRESS, help="output format")


def run(arguments: argparse.Namespace) -> int:
    """Print the list or the pressed controls. Exit code 0; 4 if there is no gamepad."""
    from joshua.tools import ExitCode

    if arguments.watch is not None:
        return _watch(arguments.watch, arguments.duration)
    found = _found()
    if getattr(arguments, "format", "text") == "json":
        sys.stdout.write(json.dumps([_as_json(device) for device in found], indent=2) + "\n")
    else:
        sys.stdout.write("".join(_paragraph(device) for device in found) or NOTHING)
    return ExitCode.OK if any(device.capabilities for device in found) else ExitCode.HARDWARE


def _found() -> list[Found]:
    """Return gamepads, and devices that cannot be identified."""
    from joshua_teleop_input.backends import prefers_sdl
    from joshua_teleop_input.discovery import DEVICE_FOLDER, Found, find_devices
    from joshua_teleop_input.events import Capabilities

    if prefers_sdl(""):
        from joshua_teleop_input.sdl_pad import names_found

        return [Found("", Capabilities(name)) for name in names_found()]
    return [device for device in find_devices(Path(DEVICE_FOLDER)) if device.is_gamepad or device.problem]


def _paragraph(device: Found) -> str:
    facts = device.capabilities
    if facts is None:
        return f"{device.path}: {device.problem}\n"
    place = device.path or "by SDL"
    return f'{place}: {facts.name} ({facts.vendor:04x}:{facts.product:04x})\n  device: "{facts.name}"\n'


def _as_json(device: Found) -> dict[str, Any]:
    facts = device.capabilities
    return {
        "path": device.path,
        "name": facts.name if facts else "",
        "vendor": facts.vendor if facts else 0,
        "product": facts.product if facts else 0,
        "problem": device.problem,
    }


def _watch(wanted: str, duration_s: float | None) -> int:
    """Print pressed controls by JOSHUA's name and the kernel's."""
    from joshua.api import DeviceError
    from joshua.tools import ExitCode

    from joshua_teleop_input.discovery import open_gamepad

    end_s = time.monotonic() + duration_s if duration_s is not None else None
    try:
        device = open_gamepad(wanted)
    except DeviceError as error:
        sys.stderr.write(f"joshua find-gamepads: {error}\n")
        return ExitCode.HARDWARE
    sys.stdout.write(
        f"{device.capabilities.name} ({device.path}); press a control to see its name; stop with Ctrl-C\n"
    )
    try:
        _show_events(device, end_s)
    except DeviceError as error:
        sys.stderr.write(f"joshua find-gamepads: {error}\n")
        return ExitCode.HARDWARE
    except KeyboardInterrupt:
        sys.stdout.write("\n")
    finally:
        device.close()
    return ExitCode.OK


def _show_events(device: EventDevice, end_s: float | None) -> None:
    from joshua_teleop_input.codes import EV_ABS, EV_KEY, axis_name, button_name
    from joshua_teleop_input.layout import standard_layout

    ours = {
        (source.is_axis, source.code): name for name, source in standard_layout(device.capabilities).items()
    }
    shown = {code: facts.value for code, facts in device.capabilities.axes.items()}
    while end_s is None or time.monotonic() < end_s:
        for event in device.read(0.1):
            if event.type == EV_KEY and event.value == 1:
                source, name = button_name(event.code), ours.get((False, event.code), "")
            elif event.type == EV_ABS and event.code in shown:
                limits = device.capabilities.axes[event.code]
                if abs(event.value - shown[event.code]) < _NOTICEABLE * (limits.maximum - limits.minimum):
                    continue
                shown[event.code] = event.value
                source, name = axis_name(event.code), ours.get((True, event.code), "")
            else:
                continue
            meaning = (
                f"used as {name}"
                if name
                else f'not used: mapping {{ name: "…" source: "{source}" }} names it'
            )
            sys.stdout.write(f"{source:20} {meaning}\n")
            sys.stdout.flush()

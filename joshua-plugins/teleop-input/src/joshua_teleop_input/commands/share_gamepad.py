"""``joshua share-gamepad``: share the gamepad of this machine with a robot."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import argparse

    from joshua_teleop_input.sharing import GamepadShare

SUMMARY = "share the gamepad of this machine with a run on another one, over SSH"

_RETRY_S = 1.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``joshua share-gamepad``."""
    parser.add_argument(
        "socket", metavar="SOCKET", type=Path, help="path of the socket to create, such as pad.sock"
    )
    parser.add_argument(
        "--device", default="", help="path of the gamepad, or part of its name; default: the first"
    )
    parser.add_argument(
        "--duration", metavar="S", type=float, default=None, help="end after this time in seconds"
    )


def run(arguments: argparse.Namespace) -> int:
    """Share a gamepad until Ctrl-C. Exit code 0; 4 if there is none or the socket cannot be made."""
    from joshua.tools import ExitCode

    from joshua_teleop_input.discovery import open_gamepad
    from joshua_teleop_input.errors import InputDeviceError
    from joshua_teleop_input.sharing import GamepadShare

    end_s = time.monotonic() + arguments.duration if arguments.duration is not None else float("inf")
    try:
        device = open_gamepad(arguments.device)
        device.close()
        share = GamepadShare(arguments.socket)
    except InputDeviceError as error:
        sys.stderr.write(f"joshua share-gamepad: {error}\n")
        return ExitCode.HARDWARE
    path = arguments.socket.absolute()
    sys.stdout.write(
        f"sharing {device.capabilities.name} at {path}; stop with Ctrl-C\n"
        f"to use it on a robot, run: ssh -R /tmp/pad.sock:{path} ROBOT\n"
        'and write in its file: gamepad_config { device: "/tmp/pad.sock" … }\n'
    )
    sys.stdout.flush()
    try:
        while time.monotonic() < end_s:
            _share(share, arguments.device, end_s)
    except KeyboardInterrupt:
        sys.stdout.write("\n")
    finally:
        share.close()
    return ExitCode.OK


def _share(share: GamepadShare, wanted: str, end_s: float) -> None:
    """Share the gamepad until it is lost, then wait a moment."""
    from joshua.api import DeviceError

    from joshua_teleop_input.discovery import open_gamepad

    try:
        device = open_gamepad(wanted)
    except DeviceError:
        time.sleep(_RETRY_S)
        return
    try:
        now = device.capabilities
        while time.monotonic() < end_s:
            now = share.serve(device, now)
    except DeviceError as error:
        sys.stderr.write(f"joshua share-gamepad: {error}; searching until it is back\n")
    finally:
        device.close()

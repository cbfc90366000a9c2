"""The subcommand ``gamepad`` of the emulator's command line."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from joshua_emulator.gamepad.server import GamepadServer


def add_parser(protocols: Any) -> None:
    """Add the options of an emulated gamepad."""
    pad = protocols.add_parser("gamepad", help="a gamepad whose records come from a UNIX socket")
    pad.add_argument("--rate", type=_rate, default=125.0, help="reports per second")
    pad.add_argument("--motion", default="", help="what moves it: demonstration")
    pad.add_argument("--path", type=Path, help="of the socket; default is gamepad.sock in the folder")
    pad.add_argument("--root", type=Path, help="folder of the sockets; default is a temporary one")
    pad.add_argument("--control", type=Path, help="control socket; default is control.sock in the folder")
    pad.add_argument("--fault", action="append", default=[], help="unplug,at_s=5, stall=1,at_s=2, dirty, …")
    pad.add_argument(
        "--until-stdin-closes", action="store_true", help="exit with the process that started this one"
    )


def make_server(options: argparse.Namespace, root: Path) -> GamepadServer:
    """Make the gamepad that the options describe. Raises ControlError and OSError."""
    from joshua_emulator.control import ControlServer
    from joshua_emulator.event_log import EventLog
    from joshua_emulator.gamepad.operations import GamepadOperations
    from joshua_emulator.gamepad.server import GamepadServer

    server = GamepadServer(options.path or root / "gamepad.sock", options.rate, EventLog())
    operations = GamepadOperations(server)
    operations.handle({"op": "motion", "kind": options.motion})
    server.control = ControlServer(options.control or root / "control.sock", operations.handle)
    return server


def ready_facts(server: GamepadServer) -> dict[str, Any]:
    """What the line of JSON at the start says about the gamepad."""
    assert server.control is not None
    return {"device": str(server.path), "name": server.name, "control": str(server.control.path)}


def _rate(text: str) -> float:
    try:
        rate = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected reports per second, found {text!r}") from None
    if not 0 < rate <= 1000:
        raise argparse.ArgumentTypeError(f"expected a rate above 0, at most 1000 Hz, found {text!r}")
    return rate

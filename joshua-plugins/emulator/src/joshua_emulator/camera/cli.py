"""The subcommand ``camera`` of the emulator's command line."""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from joshua_emulator.camera.server import CameraServer

_SIZE = re.compile(r"(\d{1,5})x(\d{1,5})")


def add_parser(protocols: Any) -> None:
    """Add the options of an emulated camera."""
    camera = protocols.add_parser("camera", help="a camera that serves Motion JPEG over HTTP on loopback")
    camera.add_argument("--size", type=_size, default=(640, 480), metavar="WxH", help="size of the pictures")
    camera.add_argument("--fps", type=_rate, default=30.0, help="frames per second")
    camera.add_argument("--port", type=int, default=0, help="TCP port on loopback; 0: a free one")
    camera.add_argument("--root", type=Path, help="folder of the control socket; default is a temporary one")
    camera.add_argument("--control", type=Path, help="control socket; default is control.sock in the folder")
    camera.add_argument("--physics", type=Path, help="socket of a simulation that draws the pictures")
    camera.add_argument("--physics-camera", default="", help="camera of its model")
    camera.add_argument("--seed", type=int, default=0, help="seed of the faults")
    camera.add_argument("--fault", action="append", default=[], help="corrupt=0.01, stall=1,at_s=2, …")
    camera.add_argument(
        "--until-stdin-closes", action="store_true", help="exit with the process that started this one"
    )


def make_server(options: argparse.Namespace, root: Path) -> CameraServer:
    """Make the camera that the options describe. Raises ControlError and OSError."""
    from joshua_emulator.camera.frames import FrameSizeError
    from joshua_emulator.camera.operations import CameraOperations
    from joshua_emulator.camera.server import CameraServer
    from joshua_emulator.camera.simulated_view import SimulatedView
    from joshua_emulator.camera.stream_faults import StreamFaults
    from joshua_emulator.control import ControlError, ControlServer
    from joshua_emulator.event_log import EventLog

    width, height = options.size
    faults = StreamFaults(options.seed)
    view = SimulatedView(options.physics, options.physics_camera) if options.physics is not None else None
    try:
        server = CameraServer(width, height, options.fps, EventLog(), faults, port=options.port, view=view)
    except FrameSizeError as error:
        raise ControlError(str(error)) from error
    operations = CameraOperations(server)
    server.control = ControlServer(options.control or root / "control.sock", operations.handle)
    return server


def ready_facts(server: CameraServer) -> dict[str, Any]:
    """What the line of JSON at the start says about the camera."""
    from joshua_emulator.camera.connection import PICTURE_PATH, STREAM_PATHS
    from joshua_emulator.camera.server import HOST

    address = f"http://{HOST}:{server.port}"
    assert server.control is not None
    return {
        "port": server.port,
        "source": address + STREAM_PATHS[-1],
        "picture": address + PICTURE_PATH,
        "control": str(server.control.path),
    }


def _size(text: str) -> tuple[int, int]:
    match = _SIZE.fullmatch(text)
    if match is None:
        raise argparse.ArgumentTypeError(f"expected WIDTHxHEIGHT, such as 640x480, found {text!r}")
    return int(match[1]), int(match[2])


def _rate(text: str) -> float:
    try:
        rate = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected frames per second, found {text!r}") from None
    if not 0 < rate <= 1000:
        raise argparse.ArgumentTypeError(f"expected frames per second above 0, at most 1000, found {text!r}")
    return rate

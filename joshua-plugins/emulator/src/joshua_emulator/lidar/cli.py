"""The subcommand ``lidar`` of the emulator's command line."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from joshua_emulator.lidar.models import MODELS

if TYPE_CHECKING:
    from joshua_emulator.station import Station


def add_parser(protocols: Any) -> None:
    """Add the options of an emulated laser scanner."""
    lidar = protocols.add_parser("lidar", help="a laser scanner in a room, on a pseudo-terminal")
    lidar.add_argument("--model", choices=tuple(MODELS), default="rplidar_a1", help="which scanner")
    lidar.add_argument("--name", default="ttyUSB0", help="device name of the port")
    lidar.add_argument("--identity", default="LIDAR0", help="USB serial number of the adapter")
    lidar.add_argument("--root", type=Path, help="folder for dev/ and sys/; default is a temporary one")
    lidar.add_argument("--control", type=Path, help="control socket; default is control.sock in the folder")
    lidar.add_argument("--seed", type=int, default=0, help="seed of the faults")
    lidar.add_argument("--fault", action="append", default=[], help="corrupt=0.01, stall,at_s=2, unplug, …")
    lidar.add_argument(
        "--until-stdin-closes", action="store_true", help="exit with the process that started this one"
    )


def make_station(options: argparse.Namespace, root: Path) -> Station:
    """Make the scanner that the options describe, plugged in. Raises OSError."""
    from joshua_emulator.control import ControlServer
    from joshua_emulator.event_log import EventLog
    from joshua_emulator.lidar.line_faults import LineFaults
    from joshua_emulator.lidar.operations import ScannerOperations
    from joshua_emulator.lidar.scanner import Scanner
    from joshua_emulator.pty_line import PtyLine
    from joshua_emulator.station import Station

    log = EventLog()
    scanner = Scanner(MODELS[options.model], log, LineFaults(options.seed))
    operations = ScannerOperations(scanner, options.name)
    control = ControlServer(options.control or root / "control.sock", operations.handle)
    line = PtyLine(root, options.identity, "Laser_Scanner")
    station = Station(scanner, line, log, control)
    operations.station = station
    station.replug(options.name)
    station.stream(scanner.produce)
    return station

"""The subcommand ``encoder`` of the emulator's command line."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from joshua_emulator.station import Station

_PROTOCOLS = ("line", "as5600", "amt21")


def add_parser(protocols: Any) -> None:
    """Add the options of emulated encoders."""
    encoder = protocols.add_parser("encoder", help="rotary encoders on a shaft, on a pseudo-terminal")
    encoder.add_argument("--kind", choices=_PROTOCOLS, default="line", help="protocol of the encoders")
    encoder.add_argument("--resolution", type=int, default=4096, help="counts in one revolution")
    encoder.add_argument("--baudrate", type=int, default=115_200, help="line speed")
    encoder.add_argument("--addresses", type=_numbers, default=(0x54,), help="of AMT21 encoders: 84,88")
    encoder.add_argument("--rate", type=float, default=200.0, help="lines a second")
    encoder.add_argument("--counter-range", type=int, default=0, help="counts after which a counter restarts")
    encoder.add_argument("--crc", action="store_true", help="each line ends with a CRC")
    encoder.add_argument("--no-times", action="store_true", help="lines carry no time")
    encoder.add_argument("--name", default="ttyACM0", help="device name of the port")
    encoder.add_argument("--identity", default="ENCODER0", help="USB serial number of the adapter")
    encoder.add_argument("--root", type=Path, help="folder for dev/ and sys/; default is a temporary one")
    encoder.add_argument("--control", type=Path, help="control socket; default is control.sock in the folder")
    encoder.add_argument("--seed", type=int, default=0, help="seed of the faults")
    encoder.add_argument(
        "--fault", action="append", default=[], help="corrupt=0.01, silent,at_s=2, unplug, …"
    )
    encoder.add_argument(
        "--until-stdin-closes", action="store_true", help="exit with the process that started this one"
    )


def make_station(options: argparse.Namespace, root: Path) -> Station:
    """Make the encoders that the options describe, plugged in. Raises OSError."""
    from joshua_emulator.control import ControlServer
    from joshua_emulator.encoder.device import EncoderDevice
    from joshua_emulator.encoder.operations import EncoderOperations
    from joshua_emulator.event_log import EventLog
    from joshua_emulator.lidar.line_faults import LineFaults
    from joshua_emulator.pty_line import PtyLine
    from joshua_emulator.station import Station

    log = EventLog()
    device = EncoderDevice(
        options.kind,
        options.resolution,
        options.baudrate,
        log,
        LineFaults(options.seed),
        addresses=options.addresses,
        rate_hz=options.rate,
        counter_range=options.counter_range,
        crc=options.crc,
        times=not options.no_times,
    )
    operations = EncoderOperations(device, options.name)
    control = ControlServer(options.control or root / "control.sock", operations.handle)
    station = Station(device, PtyLine(root, options.identity, "Encoder"), log, control)
    operations.station = station
    station.replug(options.name)
    if options.kind != "amt21":
        station.stream(device.produce)
    return station


def _numbers(text: str) -> tuple[int, ...]:
    return tuple(int(part, 0) for part in text.split(","))

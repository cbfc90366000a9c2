"""Checks of ``joshua doctor`` for serial ports: permissions, delays, and how a file names them."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

from joshua.tools import DoctorResult, ExitCode, Level

from joshua_serial.doctor import brltty, latency_timer, modem_manager, permissions, usb

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterator

    from joshua.tools import Host, NodeSpec

CHECKS = (permissions.check, latency_timer.check, brltty.check, modem_manager.check, usb.check)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options that choose a port, and that write udev rules."""
    parser.add_argument(
        "--port", dest="ports", metavar="PATH", action="append", default=[], help="check this port only"
    )
    parser.add_argument(
        "--udev",
        metavar="PATH",
        nargs="?",
        const="-",
        default="",
        help="print udev rules that give each adapter a persistent name, or write them to a file or folder",
    )


def begin(arguments: argparse.Namespace, host: Host) -> int | None:
    """Reject contradictory options; write the udev rules instead of running the checks."""
    if arguments.config and arguments.ports:
        sys.stderr.write(
            "joshua doctor: --config checks the devices of the file, --port checks one port: leave one out\n"
        )
        return ExitCode.INVALID
    if not arguments.udev:
        return None
    from joshua_serial.doctor.udev_command import write_rules

    return write_rules(arguments, host)


def check_name(spec: NodeSpec, settings: Any) -> Iterator[DoctorResult]:
    """Suggest naming an adapter by its identity."""
    by_path = getattr(settings, "port", "") and not (
        getattr(settings, "serial_number", "") or getattr(settings, "vid_pid", "")
    )
    if by_path and "/by-id/" not in settings.port and settings.port.startswith("/dev/tty"):
        yield DoctorResult(
            Level.NOTE,
            "devices",
            spec.full_name,
            f"names its port by path, {settings.port}, which may change when it is plugged in again",
            f"run `joshua find-port --write CONFIG --node {spec.name}`",
        )


NODE_CHECKS = (check_name,)

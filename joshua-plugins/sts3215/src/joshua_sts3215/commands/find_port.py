"""``joshua find-port``: the USB serial adapters of this machine and how a file names them."""

from __future__ import annotations

import json
import os
import sys
from dataclasses import asdict
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import argparse

    from joshua.devices.usb_ports import PortEntry

SUMMARY = "list the USB serial adapters of this machine"

NOTHING = """no USB serial adapter was found

Plug one in and switch on the arm's supply. If it is plugged in already:
  - lsusb shows whether the computer sees it; if not, try another cable or socket
  - in a container or a virtual machine, pass the device on (such as docker run --device /dev/ttyACM0)
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of ``joshua find-port``."""
    import argparse

    parser.add_argument(
        "--format", choices=("text", "json"), default=argparse.SUPPRESS, help="form of the list"
    )


def run(arguments: argparse.Namespace, device_root: str = "/") -> int:
    """Prints the list. Exit code 0; 4 where there is no adapter.

    Args:
        device_root: folder that holds ``dev`` and ``sys``: ``/`` for the host's own devices.
    """
    from joshua.cli.exit_codes import ExitCode
    from joshua.devices.usb_ports import list_ports

    ports = list_ports(device_root)
    if getattr(arguments, "format", "text") == "json":
        sys.stdout.write(json.dumps([asdict(port) for port in ports], indent=2) + "\n")
    else:
        sys.stdout.write("\n".join(map(paragraph, ports)) if ports else NOTHING)
    return ExitCode.OK if ports else ExitCode.HARDWARE


def paragraph(port: PortEntry) -> str:
    """One adapter for people: what to write into ``comm.serial``, the lasting name first."""
    lines = [port.path]
    if port.serial_number:
        lines.append(f'  serial_number: "{port.serial_number}"')
    lines.append(f'  vid_pid: "{port.vid_pid}"')
    lines.append(f'  port: "{port.by_id or port.path}"')
    if not os.access(port.path, os.R_OK | os.W_OK):
        lines.append("  no permission: sudo usermod -aG dialout $USER, then log in again")
    return "\n".join(lines) + "\n"

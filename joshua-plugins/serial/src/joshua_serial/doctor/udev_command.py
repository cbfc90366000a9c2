"""``joshua doctor --udev``: prints the rules, or writes them where udev reads them."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from joshua.api import DeviceError
from joshua.tools import ExitCode

from joshua_serial.doctor.udev import FILE_NAME, NotOurs, install, rules
from joshua_serial.usb_ports import Endpoint, PortEntry, list_ports, resolve

if TYPE_CHECKING:
    import argparse

    from joshua.tools import Host

NEXT = "sudo udevadm control --reload && sudo udevadm trigger"


def write_rules(arguments: argparse.Namespace, host: Host) -> int:
    """Exit code 0; 2 if the file cannot be written, 4 if there is no adapter."""
    ports = list_ports(str(host.root))
    if not ports:
        sys.stderr.write(
            "joshua doctor: no USB serial adapter is plugged in. Plug in each adapter that needs a rule, "
            "then try again\n"
        )
        return ExitCode.HARDWARE
    text = rules(ports, _names(arguments, host, ports))
    if arguments.udev == "-":
        sys.stdout.write(text)
        sys.stderr.write(f"save it as /etc/udev/rules.d/{FILE_NAME}, then run: {NEXT}\n")
        return ExitCode.OK
    try:
        target = install(text, Path(arguments.udev))
    except NotOurs as error:
        sys.stderr.write(f"joshua doctor: {error}\n")
        return ExitCode.INVALID
    except OSError as error:
        sys.stderr.write(
            f"joshua doctor: {arguments.udev} cannot be written: {error.strerror}\n"
            f"  do: joshua doctor --udev | sudo tee /etc/udev/rules.d/{FILE_NAME}\n"
        )
        return ExitCode.INVALID
    sys.stdout.write(f"{target}: written\nnow run: {NEXT}\n")
    return ExitCode.OK


def _names(arguments: argparse.Namespace, host: Host, ports: Sequence[PortEntry]) -> dict[str, str]:
    """Return the nodes of the configuration by the path of their adapter."""
    if not arguments.config:
        return {}
    from joshua.tools import load, load_registry

    from joshua_serial.ports.write_command import node_ports

    loaded = load(arguments.config, tuple(arguments.overrides), load_registry().message_modules())
    names = {}
    paths = {Path(port.path).resolve(): port.path for port in ports}
    for node in node_ports(loaded):
        endpoint = Endpoint(node.port, node.serial_number, node.vid_pid, str(host.root))
        try:
            found = Path(resolve(endpoint).path).resolve()
        except DeviceError:
            continue  # not plugged in, so it gets no rule
        if found in paths:
            names[paths[found]] = node.node
    return names

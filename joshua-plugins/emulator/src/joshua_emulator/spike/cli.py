"""The subcommand ``spike`` of the emulator's command line."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from joshua_emulator.spike.machine import HubMachine

PORTS = "ABCDEF"


def add_parser(protocols: Any) -> None:
    """Add the options of an emulated hub."""
    hub = protocols.add_parser("spike", help="a LEGO SPIKE hub with Pybricks, over virtual Bluetooth")
    hub.add_argument("--name", default="Pybricks Hub", help="name under which the hub advertises")
    hub.add_argument("--ports", type=_ports, default=("A", "B"), help="ports with motors, such as A,B")
    hub.add_argument("--root", type=Path, help="folder of the control socket; default is a temporary one")
    hub.add_argument("--control", type=Path, help="control socket; default is control.sock in the folder")
    hub.add_argument("--motion", help="motion of the user's hand: sine,amplitude_rad=0.4")
    hub.add_argument("--fault", action="append", default=[], help="stall=A, unplug,at_s=5, corrupt=0.05, …")
    hub.add_argument(
        "--until-stdin-closes", action="store_true", help="exit with the process that started this one"
    )


def make_machine(options: argparse.Namespace, root: Path) -> HubMachine:
    """Make the hub that the options describe. Raises ControlError and OSError."""
    from joshua_emulator.control import ControlError, ControlServer
    from joshua_emulator.spike.runner import NoMicroPythonError, micropython_command

    try:
        from joshua_emulator.spike.machine import HubMachine
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] != "bumble":
            raise
        from joshua.tools import install

        command = install("joshua-emulator", "spike")
        raise ControlError(f"an emulated hub needs bumble, which is not installed: {command}") from error
    from joshua_emulator.spike.operations import HubOperations

    try:
        micropython_command()
    except NoMicroPythonError as error:
        raise ControlError(str(error)) from error
    machine = HubMachine(options.name, options.ports)
    machine.control = ControlServer(options.control or root / "control.sock", HubOperations(machine).handle)
    return machine


def ready_facts(machine: HubMachine) -> dict[str, Any]:
    """What the line of JSON at the start says about the hub."""
    assert machine.control is not None
    return {
        "port": machine.port,
        "address": machine.radio.address,
        "adapter": f"tcp-client:127.0.0.1:{machine.port}",
        "control": str(machine.control.path),
    }


def _ports(text: str) -> tuple[str, ...]:
    ports = tuple(part.strip() for part in text.split(",") if part.strip())
    if (
        not ports
        or len(set(ports)) != len(ports)
        or any(port not in PORTS or len(port) > 1 for port in ports)
    ):
        raise argparse.ArgumentTypeError(
            f"expected letters of A to F, each once, such as A,B; found {text!r}"
        )
    return ports

"""Survey of serial ports: whether they can be opened, which process uses them, which motors reply."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from joshua.api import DeviceError
from joshua.tools import node_that_holds

from joshua_serial.errors import PortBusy
from joshua_serial.found_motor import FoundMotor
from joshua_serial.port import SerialPort
from joshua_serial.port_holders import holders
from joshua_serial.usb_ports import Endpoint, PortEntry, list_ports, resolve

# Classes of bus tools by the block of their driver; ``joshua_servo.bus_tools`` says what each can do.
Families = Mapping[str, type[Any]]


@dataclass(frozen=True)
class PortSurvey:
    """Result of the survey for one port.

    Attributes:
        problem: why it cannot be used, with the remedy; "" if it can.
        is_in_run: whether a node of a running system uses it.
        is_scanned: whether the port was scanned for motors.
        motors: those that reply, with the configuration block of their family.
    """

    entry: PortEntry
    problem: str = ""
    is_in_run: bool = False
    is_scanned: bool = False
    motors: tuple[tuple[str, FoundMotor], ...] = ()


def chosen_ports(paths: Iterable[str], device_root: str) -> list[PortEntry]:
    """Return the named ports, or else all USB serial ports. A named path need not exist."""
    named = [resolve(Endpoint(path, device_root=device_root)) for path in paths]
    return named or list_ports(device_root)


def survey(entries: Iterable[PortEntry], families: Families, device_root: str) -> Iterator[PortSurvey]:
    """Survey ports; scan for motors of ``families``. Without families nothing is sent."""
    for entry in entries:
        yield _scan(entry, families, device_root) if families else PortSurvey(entry, access_problem(entry))


def access_problem(entry: PortEntry) -> str:
    """Return why a port cannot be used, without opening it."""
    path = Path(entry.path)
    if not path.exists():
        return f"{path}: no such serial port"
    if not os.access(path, os.R_OK | os.W_OK):
        return f"{path}: this user may not open the port; joshua doctor says how to get that right"
    return node_that_holds(holders(entry.path))


def _scan(entry: PortEntry, families: Families, device_root: str) -> PortSurvey:
    usual = next(iter(families.values())).baudrates[0]
    port = SerialPort(Endpoint(entry.path, device_root=device_root), usual)
    try:
        port.open()
        if sys.stderr.isatty():
            sys.stderr.write(f"{entry.path}: looking for motors\n")
        return PortSurvey(entry, is_scanned=True, motors=tuple(_motors(port, families)))
    except PortBusy as error:
        node = node_that_holds(holders(entry.path))
        return PortSurvey(entry, node or str(error), is_in_run=bool(node))
    except DeviceError as error:
        return PortSurvey(entry, str(error))
    finally:
        port.close()


def _motors(port: SerialPort, families: Families) -> Iterator[tuple[str, FoundMotor]]:
    """Scan at the usual line speeds first, because a bus of one family needs no scan for the others."""
    tools = {block: family(port) for block, family in families.items()}
    found = {block: list(item.scan(item.baudrates[:1])) for block, item in tools.items()}
    present = [block for block, motors in found.items() if motors]
    for block in present or tools:
        item = tools[block]
        yield from ((block, motor) for motor in found[block])
        yield from ((block, motor) for motor in item.scan(item.baudrates[1:]))

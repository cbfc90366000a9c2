"""``joshua motors list``: the motors on each port, one line for each."""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING

from joshua.tools import ExitCode, columns, printable
from joshua_serial.ports.bus_plugins import installed_bus_tools, short_name
from joshua_serial.ports.survey import Families, PortSurvey, chosen_ports, survey
from joshua_serial.ports.text import NOTHING, as_json, remarks

if TYPE_CHECKING:
    import argparse


def run(arguments: argparse.Namespace, device_root: str = "/") -> int:
    """Print the motors. Exit code 0; 4 if no motor replies or a port cannot be used."""
    families = installed_bus_tools()
    entries = chosen_ports(arguments.ports, device_root)
    found = list(survey(entries, families, device_root))
    if getattr(arguments, "format", "text") == "json":
        sys.stdout.write(json.dumps([as_json(item) for item in found], indent=2) + "\n")
    else:
        sys.stdout.write("\n".join(map(printable, _lines(found, families))) + "\n" if found else NOTHING)
    failed = any(item.problem for item in found) or not any(item.motors for item in found)
    return ExitCode.HARDWARE if failed else ExitCode.OK


def _lines(found: list[PortSurvey], families: Families) -> list[str]:
    rows = [("PORT", "KIND", "ID", "BAUD RATE", "MODEL", "FIRMWARE", "VOLTAGE", "TEMPERATURE", "STATE")]
    notes = []
    for item in found:
        if item.problem:
            notes.append(
                item.problem if item.entry.path in item.problem else f"{item.entry.path}: {item.problem}"
            )
        elif not item.motors:
            notes.append(f"{item.entry.path}: no motor answers. Check the supply and the cable")
        for block, motor in item.motors:
            rows.append(
                (
                    item.entry.path,
                    short_name(block),
                    str(motor.motor_id),
                    str(motor.baudrate),
                    motor.model,
                    motor.firmware,
                    "" if motor.voltage_v is None else f"{motor.voltage_v:.1f} V",
                    "" if motor.temperature_c is None else f"{motor.temperature_c:.0f} °C",
                    "; ".join(remarks(motor, families[block])) or "in order",
                )
            )
    table = columns(rows, right=frozenset({2, 3, 6, 7})) if len(rows) > 1 else []
    return [*table, *notes]

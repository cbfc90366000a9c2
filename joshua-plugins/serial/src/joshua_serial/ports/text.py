"""Ports and motors as text and as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from joshua.tools import printable

from joshua_serial.found_motor import FoundMotor
from joshua_serial.ports.survey import Families, PortSurvey

NOTHING = """no USB serial adapter was found

Plug one in and switch on the arm's supply. If it is plugged in already:
  - if lsusb does not show it, try another cable or socket
  - in a container, pass the device on: docker run --device /dev/ttyACM0
  - name a board's own serial port: joshua find-port --port /dev/ttyAMA0
"""


def paragraph(found: PortSurvey, families: Families) -> str:
    """Return one port as text: what to write into ``comm.serial``, then the motors that reply."""
    entry = found.entry
    about = [entry.product, f"driver {entry.driver}" if entry.driver else ""]
    lines = ["  ".join([entry.path, ", ".join(part for part in about if part)]).rstrip()]
    if entry.serial_number:
        lines.append(f'  serial_number: "{entry.serial_number}"')
    if entry.vid_pid:
        lines.append(f'  vid_pid: "{entry.vid_pid}"')
    lines.append(f'  port: "{entry.by_id or entry.path}"')
    if found.problem:
        lines.append("  " + found.problem.removeprefix(f"{entry.path}: ").replace("\n", "\n  "))
    elif found.is_scanned:
        lines += motor_lines(found, families)
    return "\n".join(map(printable, lines)) + "\n"


def motor_lines(found: PortSurvey, families: Families) -> list[str]:
    """Return the motors of one port, one line for each family and line speed, then their problems."""
    if not found.motors:
        names = ", ".join(tools.family for tools in families.values())
        return [f"  no motor answers (searched for {names} at every line speed). Check the supply"]
    groups: dict[tuple[str, int], list[FoundMotor]] = {}
    for block, motor in found.motors:
        groups.setdefault((block, motor.baudrate), []).append(motor)
    lines = []
    for (block, baudrate), motors in groups.items():
        ids = ", ".join(str(motor.motor_id) for motor in motors)
        word = "id" if len(motors) == 1 else "ids"
        lines.append(f"  {families[block].family} at {baudrate} bit/s: {word} {ids}{_volts(motors)}")
        lines += [
            f"    id {motor.motor_id}: {text}" for motor in motors for text in remarks(motor, families[block])
        ]
    if len(groups) > 1:
        lines.append(
            "  motors of one bus need one line speed and one family: run joshua motors setup to set them up"
        )
    return lines


def _volts(motors: Sequence[FoundMotor]) -> str:
    volts = [f"{motor.voltage_v:.1f}" for motor in motors if motor.voltage_v is not None]
    if not volts:
        return ""
    low, high = min(volts, key=float), max(volts, key=float)
    return f" ({low} V)" if low == high else f" ({low} to {high} V)"


def remarks(motor: FoundMotor, tools: type[Any]) -> list[str]:
    """Return the problems of a motor, each with its remedy."""
    if motor.shared:
        return ["several motors answer: connect one alone and change its id with joshua motors setup"]
    found = motor.alarms
    if motor.model not in tools.expected_models:
        found.append(f"is a {motor.model}, which this driver does not support")
    return found


def as_json(found: PortSurvey) -> dict[str, Any]:
    """Return one port as JSON."""
    motors: Sequence[dict[str, Any]] = [{"block": block, **asdict(motor)} for block, motor in found.motors]
    return {**asdict(found.entry), "problem": found.problem, "motors": motors if found.is_scanned else None}

"""Checks the motors on each port: which reply, and their state."""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Iterator, Sequence

from joshua.tools import DoctorResult, Host, Level
from joshua_serial.ports.bus_plugins import installed_bus_tools
from joshua_serial.ports.survey import Families, PortSurvey, chosen_ports, survey
from joshua_serial.ports.text import remarks
from joshua_serial.usb_ports import PortEntry

from joshua_servo.bus_tools import FoundMotor

NAME = "motors"
NEAR_C = 10  # degrees below the limit
NEAR_V = 0.5
DROP_V = 1.0  # between the motors of one chain
COOL_DOWN = "let it cool down and reduce its load"


def check_ports(host: Host, arguments: argparse.Namespace) -> Iterator[DoctorResult]:
    """Search for motors on the chosen ports."""
    root = str(host.root)
    entries, families = chosen_ports(arguments.ports, root), installed_bus_tools()
    if entries and families:
        yield from check_buses(entries, families, root)


def check_buses(
    entries: Sequence[PortEntry], families: Families, device_root: str = "/"
) -> Iterator[DoctorResult]:
    """Scan ports; one result for each bus that is in order, one for each thing that is not."""
    for found in survey(entries, families, device_root):
        path = found.entry.path
        if found.problem:
            text = found.problem.removeprefix(f"{path}: ")
            if found.is_in_run:
                yield DoctorResult(Level.NOTE, NAME, path, f"not checked: {text}")
            else:
                yield DoctorResult(Level.ERROR, NAME, path, text)
        elif not found.motors:
            yield DoctorResult(
                Level.NOTE,
                NAME,
                path,
                "no motor answers at any line speed",
                "if this adapter belongs to an arm, switch its supply on and check the first cable",
            )
        else:
            yield from _judge(found, families)


def _judge(found: PortSurvey, families: Families) -> Iterator[DoctorResult]:
    path = found.entry.path
    motors = [motor for _, motor in found.motors]
    results = [*_each(found, families), *_together(path, motors)]
    yield from results
    if not results:
        ids = ", ".join(str(motor.motor_id) for motor in motors)
        versions = {motor.firmware for motor in motors if motor.firmware}
        firmware = "".join(f", firmware {version}" for version in versions)
        family = families[found.motors[0][0]].family
        yield DoctorResult(Level.OK, NAME, path, f"{family} {ids} at {motors[0].baudrate} bit/s{firmware}")


def _each(found: PortSurvey, families: Families) -> Iterator[DoctorResult]:
    for block, motor in found.motors:
        subject = f"{found.entry.path} id {motor.motor_id}"
        for text in remarks(motor, families[block]):
            what, _, remedy = text.partition(": ")
            yield DoctorResult(Level.ERROR, NAME, subject, what, remedy or _remedy(motor, text))
        yield from _temperature(subject, motor)
        yield from _voltage(subject, motor)


def _remedy(motor: FoundMotor, text: str) -> str:
    if text == motor.status:
        return "find the cause (a blocked joint, heat, the supply), then switch the supply off and on"
    if text not in motor.alarms:
        return "replace it, or install its plugin"
    return COOL_DOWN if "°C" in text else "use a supply of the motors' voltage"


def _temperature(subject: str, motor: FoundMotor) -> Iterator[DoctorResult]:
    present, most = motor.temperature_c, motor.max_temperature_c
    if present is None or most is None or not most - NEAR_C < present <= most:
        return
    yield DoctorResult(
        Level.WARNING,
        NAME,
        subject,
        f"{present:.0f} °C, at most {most:.0f} °C",
        COOL_DOWN,
    )


def _voltage(subject: str, motor: FoundMotor) -> Iterator[DoctorResult]:
    present, least, most = motor.voltage_v, motor.min_voltage_v, motor.max_voltage_v
    if present is None or least is None or most is None:
        return
    if least <= present < least + NEAR_V:
        yield DoctorResult(
            Level.WARNING,
            NAME,
            subject,
            f"{present:.1f} V, allowed {least:.1f} to {most:.1f} V",
            "check the supply: its voltage drops further when the arm moves",
        )


def _together(path: str, motors: Sequence[FoundMotor]) -> Iterator[DoctorResult]:
    """Problems that only a comparison of a bus's motors shows."""
    speeds, versions = defaultdict(list), defaultdict(list)
    for motor in motors:
        speeds[motor.baudrate].append(motor.motor_id)
        if motor.firmware:
            versions[motor.model, motor.firmware].append(motor.motor_id)
    if len(speeds) > 1:
        text = "; ".join(f"{rate} bit/s: {_ids(ids)}" for rate, ids in speeds.items())
        yield DoctorResult(
            Level.ERROR,
            NAME,
            path,
            f"motors have different line speeds: {text}",
            "run `joshua motors setup` to set one line speed",
        )
    models = {model for model, _ in versions}
    if len(versions) > len(models):
        text = "; ".join(f"{firmware}: {_ids(ids)}" for (_, firmware), ids in versions.items())
        yield DoctorResult(
            Level.WARNING,
            NAME,
            path,
            f"motors have different firmware versions: {text}",
            "update all of them with the vendor's tool",
        )
    volts = [(motor.voltage_v, motor.motor_id) for motor in motors if motor.voltage_v is not None]
    if volts and max(volts)[0] - min(volts)[0] > DROP_V:
        low, high = min(volts), max(volts)
        yield DoctorResult(
            Level.WARNING,
            NAME,
            path,
            f"the voltage drops along the chain: {high[0]:.1f} V at id {high[1]}, "
            f"{low[0]:.1f} V at id {low[1]}",
            "check plugs and cables between them, or feed the chain from both ends",
        )


def _ids(ids: Sequence[int]) -> str:
    return "ids " + ", ".join(map(str, ids)) if len(ids) > 1 else f"id {ids[0]}"


DEVICE_CHECKS = (check_ports,)
